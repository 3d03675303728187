"""PyBullet, without the banner that its C code writes to standard error when it is imported."""

import ctypes
import os
import subprocess
import sys
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

__all__ = ["Engine", "pybullet", "quiet", "refusal_of", "silenced"]


def refusal_of(what: str, trial: str, *arguments: str) -> str:
    """The reason why a trial of the engine fails, a script with arguments; empty if it does not.

    It runs in a process of its own, because the engine may end that. what: the trial's name in messages.
    """
    command = [sys.executable, "-c", trial, *arguments]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
    except subprocess.TimeoutExpired:
        return f"no answer from {what} in 60 s"
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    reason = lines[-1].strip(" .\t") if lines else f"{what} ends the process with {done.returncode}"
    return reason if done.returncode else ""


class Engine:
    """PyBullet's functions for one of its clients, whose number none of the calls then names."""

    def __init__(self, client: int) -> None:
        self._client = client

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - PyBullet has no types
        call = partial(getattr(pybullet, name), physicsClientId=self._client)
        setattr(self, name, call)
        return call
