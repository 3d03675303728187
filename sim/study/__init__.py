"""Comparisons: studies of many missions, resumable and distributed."""
