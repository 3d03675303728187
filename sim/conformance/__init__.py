"""Checks that plug-ins of the simulation keep their contract."""
