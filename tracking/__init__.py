"""Cameras, detection, multi-target tracking and consensus; knows nothing of physics or planning."""
