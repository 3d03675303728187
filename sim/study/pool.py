"""Processes of this machine, each with one thread, that can be killed one at a time."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from types import TracebackType

from sim.processes.session import kill_session, lead_session
from sim.study.tasks import Task
from sim.study.trial import Flown, failed, fly, warm

# Read when a library is loaded, so they have to be there before a process starts.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"), "1"
)


class Pool:
    """So many processes, each an executor of its own: which trial a death ends is known, and the others fly on."""

    def __init__(self, workers: int) -> None:
        self._lanes = [_Lane() for _ in range(workers)]
        self._compiled = False

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        for lane in self._lanes:
            lane.end()

    def room(self) -> bool:
        """True if a process is free; until the first has compiled what is to be, others would do it again."""
        self._compiled = self._compiled or any(lane.ready for lane in self._lanes)
        return any(lane.idle for lane in (self._lanes if self._compiled else self._lanes[:1]))

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[Flown]:
        """Fly a task in a free process."""
        return next(lane for lane in self._lanes if lane.idle).submit(task, keep, timeout)

    def started(self, future: Future[Flown]) -> bool:
        """True if a task flies, its process having started."""
        return any(lane.future is future and lane.ready for lane in self._lanes)

    def drop(self, future: Future[Flown]) -> None:
        """Kill the process that a task hangs in; another takes its place."""
        for lane in self._lanes:
            if lane.future is future:
                lane.end()


class _Lane:
    """One process, started when it is needed."""

    def __init__(self) -> None:
        self.future: Future[Flown] | None = None
        self._executor: ProcessPoolExecutor | None = None
        self._greeting: Future[int] | None = None
        self._processes: list[BaseProcess] = []

    @property
    def idle(self) -> bool:
        return self.future is None or self.future.done()

    @property
    def ready(self) -> bool:
        """True if the process has started, all compiled code in it."""
        return self._greeting is not None and self._greeting.done() and self._greeting.exception() is None

    def submit(self, task: Task, keep: bool, timeout: float | None) -> Future[Flown]:
        if self.future is not None and self.future.exception() is not None:
            self.end()  # `fly` raises nothing, so the process is dead
        if self._executor is None:
            self._executor = self._start()
        self.future = self._executor.submit(_fly, task, keep=keep, timeout=timeout)
        return self.future

    def _start(self) -> ProcessPoolExecutor:
        before = multiprocessing.active_children()
        executor = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)
        with _one_thread():
            self._greeting = executor.submit(os.getpid)
        self._processes = [child for child in multiprocessing.active_children() if child not in before]
        return executor

    def end(self) -> None:
        """Kill the process and what it has started, whatever they do."""
        for process in self._processes:
            kill_session(process)
        if self._executor is not None:
            self._executor.shutdown()
        self._executor = self._greeting = self.future = None
        self._processes = []


def _begin() -> None:
    """Start of a process: leave Ctrl-C to its parent, not outlive it, and load compiled code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lead_session()
    warm()


def _fly(task: Task, *, keep: bool, timeout: float | None) -> Flown:
    """As `fly`, where Ctrl-C is ignored, so that a KeyboardInterrupt is a plug-in's."""
    try:
        return fly(task, keep=keep, timeout=timeout)
    except KeyboardInterrupt:
        return failed(task, "KeyboardInterrupt: raised by a plug-in")


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes that start in the block compute with one thread each."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
