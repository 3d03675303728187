"""Worker processes that can be ended: one that dies or hangs ends only its own task, and another takes its place."""

import faulthandler
import multiprocessing
import os
import re
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, TimeoutError
from contextlib import contextmanager
from itertools import count, takewhile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

from pebble import ProcessExpired, ProcessPool

from sim.installation import ROOT
from sim.processes.exits import describe_exit

Result = TypeVar("Result")
CONTEXT = multiprocessing.get_context("spawn")
LOST = (ProcessExpired, TimeoutError)  # exceptions of tasks whose process died, or was killed in time
_OURS = tuple(f"{ROOT / name}{os.sep}" for name in ("sim", "planning", "tracking"))
_FRAME = re.compile(r'File "(.+)", line (\d+) in (.+)')  # of a traceback by faulthandler


class Workers:
    """Processes that run tasks; made by `start_workers`."""

    def __init__(self, pool: ProcessPool, traces: Path) -> None:
        self._pool = pool
        self._traces = traces
        self._names = map(str, count())  # names of the tasks' traces

    def submit(self, work: Callable[[], Result], timeout: float | None = None, grace: float = 0.0) -> Future[Result]:
        """Call `work` in the next free process, and kill it if it takes longer than `timeout` and `grace` s.

        The time does not include waiting, the start of the process and its preparation. The future's exception is a
        TimeoutError then, and a ProcessExpired if the process dies. Its text says how the task ended, and at which
        place in a plug-in if that is known: "its process was killed by SIGSEGV (planner.py:12, in plan)".
        """
        trace = self._traces / next(self._names)
        limit = None if timeout is None else timeout + grace
        ended: Future[Result] = Future()
        flying: Future[Result] = self._pool.schedule(_run_traced, (trace, limit, work), timeout=limit)

        def pass_on(inner: Future[Result]) -> None:
            if inner.cancelled():
                ended.cancel()
            if not ended.set_running_or_notify_cancel():
                return
            error = inner.exception()
            if error is None:
                ended.set_result(inner.result())
            elif isinstance(error, LOST):
                ended.set_exception(type(error)(f"{_describe_end(error, timeout)}{_find_place(trace)}"))
            else:
                ended.set_exception(error)

        flying.add_done_callback(pass_on)
        ended.add_done_callback(lambda ended: ended.cancelled() and not flying.done() and flying.cancel())
        return ended


def _find_place(trace: Path) -> str:
    """Place in a plug-in where a task died or was killed: " (planner.py:12, in plan)"; empty if it is not known."""
    try:
        text = trace.read_text()
    except OSError:
        return ""
    frames = _FRAME.findall(text.rpartition("(most recent call first):")[2])  # of the main thread, the last one
    if not frames:
        return ""
    foreign = list(takewhile(lambda frame: not frame[0].startswith(_OURS), frames)) or frames[:1]
    folder = os.path.dirname(foreign[-1][0])  # of the plug-in, which our code called; others are its libraries
    file, line, function = next(frame for frame in foreign if os.path.dirname(frame[0]) == folder)
    return f" ({file}:{line}, in {function})"


@contextmanager
def start_workers(number: int, prepare: Callable[..., object], *arguments: object) -> Iterator[Workers]:
    """Start processes, each of which calls `prepare(*arguments)` before its first task, and end them after the block.

    They leave Ctrl-C to this process, and end with it.
    """
    pool = ProcessPool(number, initializer=_begin, initargs=(prepare, arguments), context=CONTEXT)
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


def _describe_end(error: BaseException, timeout: float | None) -> str:
    """How a task ended whose process died or was killed."""
    if not isinstance(error, ProcessExpired):
        return f"took longer than the timeout of {timeout:g} s"
    return f"its process {describe_exit(error.exitcode)}"


def _begin(prepare: Callable[..., object], arguments: tuple[object, ...]) -> None:
    """Prepare a worker, and let it end when its parent process does."""
    end_with_parent()
    prepare(*arguments)


def end_with_parent() -> None:
    """Let this process end when its parent process does, however that ends."""
    threading.Thread(target=_wait_for_parent, daemon=True).start()


def _wait_for_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run_traced(trace: Path, limit: float | None, work: Callable[[], Result]) -> Result:
    """Run a task; if it crashes or is about to be killed, the file `trace` says what it was doing."""
    with open(trace, "w") as file:
        faulthandler.enable(file, all_threads=False)
        if limit is not None:
            faulthandler.dump_traceback_later(0.9 * limit, file=file)
        try:
            return work()
        finally:
            faulthandler.cancel_dump_traceback_later()
            faulthandler.disable()
            trace.unlink()
