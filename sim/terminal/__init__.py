"""Output of the terminal: messages, progress, results, lists."""
