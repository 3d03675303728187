"""Trials on a dask cluster: the extra `[dask]`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any, cast

from sim.scenario.errors import InputError
from sim.study.tasks import Task
from sim.study.trial import Flown, fly

_POLL = 2.0  # s, between questions to the scheduler
_CONNECT = 10.0  # s


class Cluster:
    """A dask cluster. What hangs ends with its worker, which a nanny starts again; dask flies its other tasks anew."""

    def __init__(self, client: Any) -> None:  # noqa: ANN401 - of a library that may not be there
        self._client = client
        self._executor = client.get_executor(pure=False)
        self._names: dict[Future[Flown], str] = {}
        self._submitted = 0
        self._asked = 0.0
        self._workers: dict[str, str] = {}  # of each task that flies, as last asked

    def room(self) -> bool:
        """Always: the scheduler has a queue, by which clusters that adapt know how many workers to start."""
        return True

    def submit(self, task: Task, *, keep: bool, timeout: float | None) -> Future[Flown]:
        """Submit under a name of its own, so that a second try is not taken for the first."""
        self._submitted += 1
        name = f"{task.key}-{self._submitted}"
        future: Future[Flown] = self._executor.submit(fly, task, keep=keep, timeout=timeout, key=name)
        self._names[future] = name
        return future

    def started(self, future: Future[Flown]) -> bool:
        """True if a worker flies it; one is given more than it has threads for, first come, first served."""
        if time.monotonic() - self._asked > _POLL:
            threads, ours = self._client.nthreads(), set(self._names.values())
            self._workers = {
                name: worker
                for worker, names in self._client.processing().items()
                for name in sorted(ours.intersection(names), key=_order)[: threads.get(worker, 0)]
            }
            self._asked = time.monotonic()
        return self._names[future] in self._workers

    def drop(self, future: Future[Flown]) -> None:
        """Cancel it, and restart the worker that it hangs in."""
        worker = self._workers.get(self._names.pop(future))
        future.cancel()
        if worker is not None:
            self._client.restart_workers([worker], raise_for_error=False)


def _order(name: str) -> int:
    return int(name.rpartition("-")[2])


@contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """The cluster at an address; InputError if it does not answer or dask is not installed."""
    try:
        from distributed import Client
        from distributed.comm.addressing import parse_address, parse_host_port
        from distributed.comm.registry import get_backend
    except ImportError as error:
        raise InputError("--dask: needs dask.distributed: pip install 'understory[dask]'") from error
    try:
        scheme, place = parse_address(address)  # else a client half made complains 20 s later, with a traceback
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
