"""Scenarios: settings, their limits and their files."""
