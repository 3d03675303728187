"""The installation of Understory: its folder and its data files."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
ASSETS = ROOT / "assets"  # found by path: a folder of the user's may have the name of a package
