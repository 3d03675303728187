"""Processes that lead a session, so that what they have started is ended with them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from contextlib import suppress
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess


def lead() -> None:
    """Make a session of this process and of what it will start, which ends when its parent does.

    A killed parent ends nobody: its processes would wait for it for ever.
    """
    os.setsid()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def end(process: BaseProcess) -> None:
    """Kill a process, if it was started, and what it has started since it leads a session, whatever they do.

    Who has made a session or a process group of its own escapes.
    """
    if process.pid is None:
        return
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os.killpg(os.getpid(), signal.SIGKILL)
