"""Recorded frames, rendered again and annotated."""
