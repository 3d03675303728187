"""Import of plug-ins, their errors, and checks of their results."""
