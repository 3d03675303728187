"""Backends that fly trials: their interface, processes of this machine, executors of the caller and dask clusters."""

import logging
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from typing import Any, NamedTuple, Protocol, cast

from sim.mission.warmup import warm_up
from sim.processes.workers import Workers, count_cores, start_workers
from sim.study.tasks import Task
from sim.study.trial_flight import TrialResult, fly_trial
from tracking.errors import InputError

GRACE = 2.0  # s after the timeout, within which a slow trial ends by itself


class Backend(Protocol):
    """Executor of trials."""

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[TrialResult]:
        """Submit `fly_trial` for a task."""

    def end_hanging(self, seconds: float) -> Sequence[Future[TrialResult]]:
        """End trials that have flown for longer than so many seconds, if their futures do not end by themselves."""
        return ()

    def find_crash_place(self, task: Task) -> str:
        """Place in a plug-in where a trial's process died or hung, in brackets; empty if it is not known."""
        return ""

    def describe_loss(self) -> str:
        """Why no trial can be flown any more; empty if trials can be flown."""
        return ""

    def describe_wait(self) -> str:
        """What trials wait for before they are flown; empty if they are flown."""
        return ""


class ExecutorBackend(Backend):
    """Executor of the caller. A trial that hangs in it cannot be ended, so it is waited for."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[TrialResult]:
        """Submit the task to the executor."""
        return self._executor.submit(fly_trial, task, keep=keep, timeout=timeout)


_CONNECT = 10.0  # s, timeout


class _Start(NamedTuple):
    """The start of a trial on a cluster."""

    worker: str  # its address
    time: float  # s, of this process's clock


class Cluster(Backend):
    """A dask cluster. It gets all tasks at once, because an adaptive cluster starts workers by the length of its queue.

    A trial that hangs is ended with its worker. A nanny starts the worker again, and dask repeats its other tasks.
    """

    def __init__(self, client: Any, address: str) -> None:  # noqa: ANN401 - its library may not be installed
        self._client, self._address = client, address
        self._executor = client.get_executor(pure=False)
        self._topic = f"understory-{client.id}"
        self._submitted = 0
        self._names: dict[Future[TrialResult], str] = {}  # names of trials that have not ended
        self._begun: dict[str, _Start] = {}  # trials in flight, by name
        client.subscribe_topic(self._topic, self._hear)

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[TrialResult]:
        """Submit the task under a unique name, so that dask does not take a second attempt for the first."""
        self._submitted += 1
        name = f"{task.key}-{self._submitted}"
        future: Future[TrialResult] = self._executor.submit(
            _fly_announced, task, keep=keep, timeout=timeout, topic=self._topic, name=name, key=name
        )
        self._names[future] = name
        future.add_done_callback(self._forget)
        return future

    def end_hanging(self, seconds: float) -> list[Future[TrialResult]]:
        """Cancel trials that began so long ago and are still at their workers, and restart these workers.

        A trial of a lost worker waits for another one, and is left alone.
        """
        limit = time.monotonic() - seconds
        late = {name: start.worker for name, start in list(self._begun.items()) if start.time < limit}
        if not late:  # the usual case, in which the scheduler need not be asked
            return []
        processing = self._client.processing()
        late = {name: worker for name, worker in late.items() if name in processing.get(worker, ())}
        hanging = [future for future, name in list(self._names.items()) if name in late]
        for future in hanging:
            future.cancel()
        if late:
            self._client.restart_workers([*set(late.values())], raise_for_error=False)
        return hanging

    def describe_loss(self) -> str:
        """Why no trial can be flown: the scheduler no longer answers, and its futures are cancelled."""
        lost = self._client.status != "running"
        return f"--dask: {self._address!r} no longer answers" if lost else ""

    def describe_wait(self) -> str:
        """Why trials wait: the cluster has no workers."""
        with suppress(OSError):  # of a scheduler that is being lost
            if self._client.status == "running" and not self._client.nthreads():
                return "no workers, waiting"
        return ""

    def _hear(self, event: tuple[float, tuple[str, str]]) -> None:
        """Note a worker's announcement that a trial has begun, for the first time or again."""
        name, worker = event[1]
        self._begun[name] = _Start(worker, time.monotonic())

    def _forget(self, future: Future[TrialResult]) -> None:
        """Remove the entries of a trial that has ended."""
        self._begun.pop(self._names.pop(future, ""), None)


def _fly_announced(task: Task, *, keep: bool, timeout: float | None, topic: str, name: str) -> TrialResult:
    """Fly a trial in a worker, which announces the start under a topic with the trial's name."""
    from distributed import get_worker

    worker: Any = cast(Any, get_worker)()
    return fly_trial(task, keep=keep, timeout=timeout, begun=lambda: worker.log_event(topic, (name, worker.address)))


@contextmanager
def connect(address: str) -> Iterator[Cluster]:
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
        yield Cluster(client, address)
    finally:
        if client.status != "running":  # the end of its attempts to connect again would be logged with a traceback
            logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        client.close(timeout=_CONNECT)


# Libraries read these variables when they are loaded, so they have to be set before a process starts.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"), "1"
)


class Pool(Backend):
    """Processes of this machine. One that dies or hangs ends only its own trial, and another takes its place."""

    def __init__(self, workers: int | None = None) -> None:
        """Make a pool of `workers` processes, by default one for each core that this process may use."""
        self.count = workers or count_cores()
        self._started = ExitStack()
        self._workers: Workers | None = None

    def __enter__(self) -> "Pool":
        return self

    def __exit__(self, *error: object) -> None:
        self._started.close()

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[TrialResult]:
        """Fly a task in the next free process, which is killed if it hangs; the first task starts the processes."""
        if self._workers is None:
            self._started.enter_context(_limit_threads())
            self._workers = self._started.enter_context(start_workers(self.count, warm_up))
        limit = None if timeout is None else timeout + GRACE
        return self._workers.submit(task.key, limit, partial(fly_trial, task, keep=keep, timeout=timeout))

    def find_crash_place(self, task: Task) -> str:
        """Place in a plug-in where a trial's process died or hung."""
        return self._workers.find_crash_place(task.key) if self._workers else ""


@contextmanager
def _limit_threads() -> Iterator[None]:
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
