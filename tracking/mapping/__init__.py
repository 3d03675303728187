"""Maps of trees from frames."""
