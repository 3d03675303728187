"""The fit of the camera noise model to rendered people."""
