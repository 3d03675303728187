"""The physical world: engine, forest, people, quadrotors."""
