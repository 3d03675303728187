"""Executors that fly trials: processes of this machine, and a dask cluster."""

import logging
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any, ParamSpec, TypeVar, cast

from sim.mission.warmup import warm_up
from sim.processes.cores import count_cores
from sim.processes.workers import Workers, start_workers
from sim.study.store import StoreError
from sim.terminal.console import print_remarks
from tracking.errors import InputError

GRACE = 2.0  # s after the timeout, within which a slow trial ends by itself
_CONNECT = 10.0  # s, timeout
# Libraries read these variables when they are loaded, so they have to be set before a process starts.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"), "1"
)
Given = ParamSpec("Given")
Result = TypeVar("Result")


class Pool(Executor):
    """Processes of this machine. One that dies or hangs ends only its own trial, and another takes its place.

    The first trial starts the processes. The end of the pool ends what still flies.
    """

    def __init__(self, workers: int | None = None, timeout: float | None = None) -> None:
        """Make a pool of `workers` processes, by default one for each core that this process may use.

        timeout: wall time [s] of a trial, shortly after which its process is killed.
        """
        self.count = workers or count_cores()
        self._timeout = timeout
        self._started = ExitStack()
        self._workers: Workers | None = None

    def submit(self, work: Callable[Given, Result], /, *arguments: Given.args, **named: Given.kwargs) -> Future[Result]:
        """Call `work` in the next free process."""
        if self._workers is None:
            self._started.enter_context(_limit_threads())
            self._workers = self._started.enter_context(start_workers(self.count, warm_up))
        return self._workers.submit(partial(work, *arguments, **named), self._timeout, GRACE)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes."""
        self._started.close()


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


@contextmanager
def connect(address: str, timeout: float = _CONNECT) -> Iterator[Executor]:
    """The executor of the dask cluster at an address; InputError if it does not answer or dask is not installed.

    It gets all trials at once, because an adaptive cluster starts workers by the length of its queue. Trials of a
    worker that dies fly on others. A StoreError of `complete` says so if the scheduler is lost.
    """
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
        client: Any = cast(Any, Client)(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # a timeout is an OSError
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"--dask: {address!r} does not answer: {reason}") from error
    try:
        if not client.nthreads():
            print_remarks(f"--dask: {address!r} has no workers yet; trials wait for the first")
        yield client.get_executor(pure=False)
    except StoreError as error:
        if client.status == "running":
            raise
        raise StoreError(f"--dask: {address!r} no longer answers") from error
    finally:
        if client.status != "running":  # the end of its attempts to connect again would be logged with a traceback
            logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        client.close(timeout=timeout)
