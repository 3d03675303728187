"""Worker processes, and signals that ask to stop."""
