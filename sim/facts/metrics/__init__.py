"""Metrics and summary of a recorded mission."""
