"""Explanations of a person seen, hidden, held or lost."""
