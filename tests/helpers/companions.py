"""What companions do in tests."""

import os
import signal


def collect(values):
    """All values."""
    return list(values)


def fail_at_the_third(values):
    """As on a full disk."""
    next(values), next(values), next(values)
    raise OSError(28, "No space left on device", "mission.mp4")


def fail_oddly(values):
    """An exception that cannot be pickled."""
    error = ValueError("odd")
    error.made_of = lambda: None
    raise error


def die_at_the_third(values):
    """As if memory had run out."""
    next(values), next(values), next(values)
    os.kill(os.getpid(), signal.SIGKILL)


def print_and_add(values):
    """A function whose libraries print."""
    os.write(1, b"noise")
    print("noise", flush=True)
    return sum(values)
