"""PyBullet, imported when it is first used, without the banner that its C code writes to standard error.

So whatever does not fly, such as tracking and looking at recordings, works where PyBullet is missing.
"""

import ctypes
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any


@contextmanager
def silence(*descriptors: int) -> Iterator[None]:
    """Discard whatever is written to these file descriptors within the block."""
    kept = [os.dup(number) for number in descriptors]
    nowhere = os.open(os.devnull, os.O_WRONLY)
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
def silence_c_code() -> Iterator[None]:
    """Discard what C code writes to standard output and error within the block, but not what it wrote before."""
    c = ctypes.CDLL(None)
    c.fflush(None)
    with silence(1, 2):
        yield
        c.fflush(None)


class _PyBullet:
    """The functions and constants of PyBullet."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - PyBullet has no types
        with silence(2):
            import pybullet
        value = getattr(pybullet, name)
        setattr(self, name, value)
        return value


pybullet = _PyBullet()


def explain_failure(what: str, trial: str, *arguments: str) -> str:
    """Reason why a trial of the engine, a script with arguments, fails; empty if it succeeds.

    The trial runs in a separate process, because the engine may end it. what: name of the trial in messages.
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
    """PyBullet's functions, bound to one client, so that calls need not name it."""

    def __init__(self, client: int) -> None:
        self._client = client

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - PyBullet has no types
        call = partial(getattr(pybullet, name), physicsClientId=self._client)
        setattr(self, name, call)
        return call
