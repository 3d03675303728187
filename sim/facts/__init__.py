"""What follows from a recording, in numbers and words, without a pixel."""
