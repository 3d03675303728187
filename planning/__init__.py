"""Planners that turn beliefs into velocity commands; knows nothing of physics."""
