"""From an image to ground measurements and their covariances."""
