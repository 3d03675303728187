"""Formats of other programs: a module each, reader beside writer."""
