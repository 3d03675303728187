"""Classes of other people: their import and their containment."""
