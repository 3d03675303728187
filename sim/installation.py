"""The installation of Understory: its folder, its data files, and its place on the import path."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[1]
ASSETS = ROOT / "assets"  # found by path: a folder of the user's may have the name of a package


def is_current_folder(place: str) -> bool:
    """True if an entry of `sys.path` stands for the current folder."""
    return os.path.abspath(place) == os.getcwd()
