"""Maps, tiles, labels and figures."""
