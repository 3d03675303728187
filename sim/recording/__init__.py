"""Recordings of missions and their files."""
