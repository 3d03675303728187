"""Searches for the plans of least cost."""
