"""Separate processes, and signals that end them."""
