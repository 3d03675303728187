"""The error of wrong input, as opposed to a fault of the program."""

from __future__ import annotations


class InputError(ValueError):
    """The input cannot be used; the message is one line: field, value, what is allowed, the nearest valid name."""
