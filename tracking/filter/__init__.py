"""Motion models and the filter of one target, with negative information."""
