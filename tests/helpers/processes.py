"""Processes that are started with our packages on their path, and those that are left."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def python(*words, cwd=ROOT, started=False, start_new_session=False, **environment):
    """A finished Python, or a `started` one, with standard output and error as text."""
    there = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    options["start_new_session"] = start_new_session
    command = [sys.executable, *map(str, words)]
    if started:
        return subprocess.Popen(command, cwd=cwd, env=there, **options)
    return subprocess.run(command, cwd=cwd, env=there, timeout=300, **options)


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
