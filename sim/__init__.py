"""Physics, sensing, missions and the command line: the host of tracking and planning."""
