"""A mission from its settings to its folder of results."""
