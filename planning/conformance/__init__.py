"""Checks that a planner keeps its contract."""
