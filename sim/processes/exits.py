"""How a process ended, in words."""

import signal
from contextlib import suppress


def describe_exit(code: int) -> str:
    """What follows "its process", given its exit code, which is negative after a signal: "was killed by SIGSEGV"."""
    if code < 0:
        with suppress(ValueError):
            return f"was killed by {signal.Signals(-code).name}"
    return f"ended by itself, with exit code {code}"
