"""Backends that fly trials: their interface, processes of this machine, executors of the caller and dask clusters."""

import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from typing import Any, Protocol, cast

from sim.mission.warmup import warm_up
from sim.processes.isolation import kill_session, lead_session
from sim.processes.signals import ctrl_c_deferred
from sim.study.tasks import Task
from sim.study.trial import Flown, failed, fly
from tracking.errors import InputError


class Backend(Protocol):
    """Executor of trials that can end a trial."""

    def room(self) -> bool:
        """True if another task may be submitted; always so for a backend with a queue."""
        return True

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[Flown]:
        """Submit `sim.study.trial.fly` for a task."""

    def overdue(self, seconds: float) -> list[Future[Flown]]:
        """Trials that have flown for longer than so many seconds, without the time of waiting and compiling."""

    def drop(self, future: Future[Flown]) -> None:
        """Give up a task that hangs, and free its resources if possible."""


class Borrowed(Backend):
    """Executor of the caller. A trial that hangs in it cannot be ended, so it is waited for."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[Flown]:
        """Submit the task to the executor."""
        return self._executor.submit(fly, task, keep=keep, timeout=timeout)

    def overdue(self, seconds: float) -> list[Future[Flown]]:
        """No trials, because futures of Python's process pool count as running while they still wait."""
        return []

    def drop(self, future: Future[Flown]) -> None:
        """Cancel the task, which works only before it starts."""
        future.cancel()


_CONNECT = 10.0  # s, timeout


class Cluster(Backend):
    """A dask cluster. It gets all tasks at once, because an adaptive cluster starts workers by the length of its queue.

    A trial that hangs is ended with its worker. A nanny starts the worker again, and dask repeats its other tasks.
    """

    def __init__(self, client: Any) -> None:  # noqa: ANN401 - its library may not be installed
        self._client = client
        self._executor = client.get_executor(pure=False)
        self._topic = f"understory-{client.id}"
        self._submitted = 0
        self._names: dict[Future[Flown], str] = {}  # names of trials that have not ended
        self._begun: dict[str, tuple[str, float]] = {}  # worker and start [s] of trials in flight, by name
        client.subscribe_topic(self._topic, self._hear)

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[Flown]:
        """Submit the task under a unique name, so that dask does not take a second attempt for the first."""
        self._submitted += 1
        name = f"{task.key}-{self._submitted}"
        future: Future[Flown] = self._executor.submit(
            _fly_announced, task, keep=keep, timeout=timeout, announcement=(self._topic, name), key=name
        )
        self._names[future] = name
        future.add_done_callback(self._forget)
        return future

    def overdue(self, seconds: float) -> list[Future[Flown]]:
        """Trials that began so long ago and are still at their workers; those of a lost worker wait for another one."""
        limit = time.monotonic() - seconds
        late = {name: worker for name, (worker, begun) in list(self._begun.items()) if begun < limit}
        if not late:
            return []
        processing = self._client.processing()
        held = {name for name, worker in late.items() if name in processing.get(worker, ())}
        return [future for future, name in list(self._names.items()) if name in held]

    def drop(self, future: Future[Flown]) -> None:
        """Cancel the task and restart the worker in which it hangs."""
        worker, _ = self._begun.get(self._names.get(future, ""), ("", 0.0))
        future.cancel()
        if worker:
            self._client.restart_workers([worker], raise_for_error=False)

    def _hear(self, event: tuple[float, tuple[str, str]]) -> None:
        """Note a worker's announcement that a trial has begun, for the first time or again."""
        name, worker = event[1]
        self._begun[name] = worker, time.monotonic()

    def _forget(self, future: Future[Flown]) -> None:
        """Remove the entries of a trial that has ended."""
        self._begun.pop(self._names.pop(future, ""), None)


def _fly_announced(task: Task, *, keep: bool, timeout: float | None, announcement: tuple[str, str]) -> Flown:
    """`fly` in a worker that announces the beginning; announcement: the topic and the trial's name."""
    from distributed import get_worker

    worker: Any = cast(Any, get_worker)()
    topic, name = announcement
    return fly(task, keep=keep, timeout=timeout, begun=lambda: worker.log_event(topic, (name, worker.address)))


@contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """Connect to the cluster at an address; InputError if it does not answer or dask is not installed."""
    try:
        from distributed import Client
        from distributed.comm.addressing import parse_address, parse_host_port
        from distributed.comm.registry import get_backend
    except ImportError as error:
        raise InputError("--dask: needs dask.distributed: pip install distributed") from error
    try:
        scheme, place = parse_address(address)  # otherwise an invalid address fails 20 s later, with a traceback
        get_backend(scheme)
        parse_host_port(place)
        client: Any = cast(Any, Client)(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # a timeout is an OSError
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"--dask: {address!r} does not answer: {reason}") from error
    try:
        yield Cluster(client)
    finally:
        client.close(timeout=_CONNECT)


# Libraries read these variables when they are loaded, so they have to be set before a process starts.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"), "1"
)


class Pool:
    """Processes with an executor each, so that the death of a process ends only its own trial."""

    def __init__(self, workers: int | None = None) -> None:
        """Make `workers` processes, by default one for each core that this process may use."""
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        self._lanes = [_Lane() for _ in range(workers or cores or 1)]
        self._compiled = False

    def __enter__(self) -> "Pool":
        return self

    def __exit__(self, *error: object) -> None:
        for lane in self._lanes:
            lane.end()

    def room(self) -> bool:
        """True if a process is free. The first process compiles alone, as the others would compile the same code."""
        self._compiled = self._compiled or any(lane.ready for lane in self._lanes)
        return any(lane.idle for lane in (self._lanes if self._compiled else self._lanes[:1]))

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[Flown]:
        """Fly a task in a free process."""
        return next(lane for lane in self._lanes if lane.idle).submit(task, keep, timeout)

    def overdue(self, seconds: float) -> list[Future[Flown]]:
        """Trials that have flown for longer than so many seconds, without the start of their process."""
        return [lane.future for lane in self._lanes if lane.future is not None and lane.seconds > seconds]

    def drop(self, future: Future[Flown]) -> None:
        """Kill the process in which a task hangs; another one takes its place."""
        for lane in self._lanes:
            if lane.future is future:
                lane.end()


class _Lane:
    """One process, started when it is needed."""

    def __init__(self) -> None:
        self.future: Future[Flown] | None = None
        self._executor: ProcessPoolExecutor | None = None
        self._greeting: Future[int] | None = None
        self._since: float | None = None  # s, time at which the task was first seen to fly
        self._processes: list[BaseProcess] = []

    @property
    def idle(self) -> bool:
        return self.future is None or self.future.done()

    @property
    def ready(self) -> bool:
        """True if the process has started and loaded all compiled code."""
        return self._greeting is not None and self._greeting.done() and self._greeting.exception() is None

    @property
    def seconds(self) -> float:
        """Time [s] of the task since this property was first read while the process was ready."""
        if self.idle or not self.ready:
            return 0.0
        if self._since is None:
            self._since = time.monotonic()
        return time.monotonic() - self._since

    def submit(self, task: Task, keep: bool, timeout: float | None) -> Future[Flown]:
        if self._executor is None:
            self._executor = self._start()
        self._since = None
        try:
            self.future = self._executor.submit(_fly, task, keep=keep, timeout=timeout)
        except BrokenProcessPool:  # the process died in its last task or afterwards
            self.end()
            return self.submit(task, keep, timeout)
        return self.future

    def _start(self) -> ProcessPoolExecutor:
        before = multiprocessing.active_children()
        executor = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)
        with _one_thread(), ctrl_c_deferred():
            self._greeting = executor.submit(os.getpid)
        self._processes = [child for child in multiprocessing.active_children() if child not in before]
        return executor

    def end(self) -> None:
        """Kill the process and all processes that it has started."""
        for process in self._processes:
            kill_session(process)
        if self._executor is not None:
            self._executor.shutdown()
        self._executor = self._greeting = self.future = None
        self._processes = []


def _begin() -> None:
    """Initialise a process: leave Ctrl-C to its parent, end with the parent, and load compiled code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    lead_session()
    warm_up()


def _fly(task: Task, *, keep: bool, timeout: float | None) -> Flown:
    """`fly` in a process that ignores Ctrl-C, so that a KeyboardInterrupt comes from a plug-in."""
    try:
        return fly(task, keep=keep, timeout=timeout)
    except KeyboardInterrupt:
        return failed(task, "KeyboardInterrupt: raised by a plug-in")


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let the processes that start in the block compute with one thread each."""
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
