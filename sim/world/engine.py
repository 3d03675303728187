"""PyBullet, without the banner that its C code writes to standard error when it is imported."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def silenced(*descriptors: int) -> Iterator[None]:
    """Send what is written to file descriptors nowhere within the block."""
    kept, nowhere = [os.dup(number) for number in descriptors], os.open(os.devnull, os.O_WRONLY)
    try:
        for number in descriptors:
            os.dup2(nowhere, number)
        yield
    finally:
        for number, copy in zip(descriptors, kept, strict=True):
            os.dup2(copy, number)
            os.close(copy)
        os.close(nowhere)


@contextmanager
def quiet() -> Iterator[None]:
    """Keep off standard output and error what C code writes within the block, and that alone."""
    c = ctypes.CDLL(None)
    c.fflush(None)
    with silenced(1, 2):
        yield
        c.fflush(None)


with silenced(2):
    import pybullet

__all__ = ["pybullet", "quiet", "silenced"]
