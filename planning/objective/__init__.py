"""Terms of the cost of plans."""
