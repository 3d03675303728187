"""The error of wrong input, as opposed to a fault of the program."""

from tracking.plugins.registry import InputError

__all__ = ["InputError"]
