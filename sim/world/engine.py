"""PyBullet, without the banner that its C code writes to standard error when it is imported."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any


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

__all__ = ["Engine", "pybullet", "quiet", "silenced"]


class Engine:
    """PyBullet's functions for one of its clients, whose number none of the calls then names."""

    def __init__(self, client: int) -> None:
        self._client = client

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - PyBullet has no types
        call = partial(getattr(pybullet, name), physicsClientId=self._client)
        setattr(self, name, call)
        return call
