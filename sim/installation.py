"""The installation of Understory: its folder and its data files."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
ASSETS = ROOT / "assets"  # found by path, not by import: the user's folder may contain a package of the same name
