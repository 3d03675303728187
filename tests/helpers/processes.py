"""Processes that are left."""

import time
from pathlib import Path


def started_with(variable, value):
    """Command lines of processes that have this in their environment."""
    found = []
    for process in Path("/proc").iterdir():
        try:
            words = (process / "environ").read_bytes().split(b"\0") if process.name.isdigit() else []
            if f"{variable}={value}".encode() in words:
                found.append((process / "cmdline").read_bytes())
        except OSError:
            pass
    return found


def ended(pid):
    """True if a process ends within 10 s; one that no process has waited for has ended, too."""
    for _ in range(100):
        try:
            if not Path(f"/proc/{pid}/cmdline").read_bytes():
                return True
        except OSError:
            return True
        time.sleep(0.1)
    return False
