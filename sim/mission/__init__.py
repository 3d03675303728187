"""The mission loop and the radio network."""
