"""Planners of other papers that are no compositions of pieces."""
