"""Meshes, textures and packaged scenarios."""

from pathlib import Path

ASSETS = Path(__file__).parent
