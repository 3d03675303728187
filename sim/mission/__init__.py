"""The mission loop, the radio network and the wind."""
