"""Worker processes that can be ended: one that dies or hangs ends only its own task, and another takes its place."""

import faulthandler
import multiprocessing
import os
import re
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, TimeoutError
from contextlib import contextmanager, suppress
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

from pebble import ProcessExpired, ProcessPool

from sim.installation import ROOT

Result = TypeVar("Result")
CONTEXT = multiprocessing.get_context("spawn")
LOST = (ProcessExpired, TimeoutError)  # exceptions of tasks whose process died, or was killed in time
_OURS = tuple(f"{ROOT / name}{os.sep}" for name in ("sim", "planning", "tracking"))
_FRAME = re.compile(r'File "(.+)", line (\d+) in (.+)')  # of a traceback by faulthandler


class Workers:
    """Processes that run tasks; made by `start_workers`."""

    def __init__(self, pool: ProcessPool, traces: Path) -> None:
        self._pool, self._traces = pool, traces

    def submit(self, name: str, limit: float | None, work: Callable[..., Result], *arguments: object) -> Future[Result]:
        """Run `work(*arguments)` in the next free process, and kill it if it takes longer than `limit` s.

        The time does not include waiting, the start of the process and its preparation. The future's exception is a
        TimeoutError then, and a ProcessExpired if the process dies. name: of the task, for `find_crash_place`.
        """
        return self._pool.schedule(_run_traced, (self._traces / name, limit, work, arguments), timeout=limit)

    def find_crash_place(self, name: str) -> str:
        """Place in a plug-in where a task died or was killed: " (planner.py:12, in plan)"; empty if it is not known."""
        try:
            trace = (self._traces / name).read_text()
        except OSError:
            return ""
        frames = _FRAME.findall(trace.rpartition("(most recent call first):")[2])  # of the main thread, the last one
        if not frames:
            return ""
        foreign = list(takewhile(lambda frame: not frame[0].startswith(_OURS), frames)) or frames[:1]
        folder = os.path.dirname(foreign[-1][0])  # of the plug-in, which our code called; others are its libraries
        file, line, function = next(frame for frame in foreign if os.path.dirname(frame[0]) == folder)
        return f" ({file}:{line}, in {function})"


@contextmanager
def start_workers(count: int, prepare: Callable[..., object], *arguments: object) -> Iterator[Workers]:
    """Start processes, each of which calls `prepare(*arguments)` before its first task, and end them after the block.

    They leave Ctrl-C to this process, and end with it.
    """
    pool = ProcessPool(count, initializer=_begin, initargs=(prepare, arguments), context=CONTEXT)
    CONTEXT.Lock()  # starts multiprocessing's resource tracker, which would unblock the signal below
    # A worker inherits the blocked signal from the thread that starts it, so Ctrl-C does no harm until it is ignored.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        pool.schedule(os.getpid)  # the first task starts the pool
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    with TemporaryDirectory(prefix="understory-") as traces:
        try:
            yield Workers(pool, Path(traces))
        finally:
            pool.stop()  # type: ignore[no-untyped-call]
            pool.join()


def count_cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def describe_end(error: BaseException, timeout: float | None) -> str:
    """How a task ended, from the exception of its future."""
    if isinstance(error, TimeoutError):
        return f"took longer than the timeout of {timeout:g} s"
    if not isinstance(error, ProcessExpired):
        return str(error)
    if error.exitcode < 0:
        with suppress(ValueError):
            return f"its process was killed by {signal.Signals(-error.exitcode).name}"
    return f"its process ended by itself, with exit code {error.exitcode}"


def _begin(prepare: Callable[..., object], arguments: tuple[object, ...]) -> None:
    """Prepare a worker, and let it end when its parent process does."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    prepare(*arguments)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run_traced(trace: Path, limit: float | None, work: Callable[..., Result], arguments: tuple[object, ...]) -> Result:
    """Run a task; if it crashes or is about to be killed, the file `trace` tells what it was doing."""
    with open(trace, "w") as file:
        faulthandler.enable(file, all_threads=False)
        if limit is not None:
            faulthandler.dump_traceback_later(0.9 * limit, file=file)
        try:
            return work(*arguments)
        finally:
            faulthandler.cancel_dump_traceback_later()
            faulthandler.disable()
            trace.unlink()
