"""The pinhole camera, and lines of sight among trees."""
