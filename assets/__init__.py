"""Meshes, textures and packaged scenarios."""
