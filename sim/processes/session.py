"""Sessions of processes, each of which is killed as a whole."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from contextlib import suppress
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess


def lead_session() -> None:
    """Make a session of this process and its later children, which ends with its parent.

    Without it, the children of a killed parent would wait for it for ever.
    """
    os.setsid()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def kill_session(process: BaseProcess) -> None:
    """Kill a process, if it was started, and its session; children in a session or group of their own escape."""
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
