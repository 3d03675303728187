"""Engine of a study, which flies trials on a backend, keeps each result as it comes and repeats failed trials once."""

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue

from sim.recording.atomic_files import whole
from sim.study.backends import Backend
from sim.study.store import Store, StoreError
from sim.study.tasks import Row, Task
from sim.study.trial import Flown, failed

ATTEMPTS = 2
_TICK = 0.5  # s, interval of checks for free processes and trials that hang
_GRACE = 2.0  # s after the timeout, within which a slow trial ends by itself
_Flying = dict[Future[Flown], tuple[Task, int]]  # trials in flight, with the number of the attempt
Heard = Callable[[Task, Row, bool], None]  # a task, its row, and whether it was flown just now


@dataclass(frozen=True)
class Options:
    """Options of a study: timeout, recordings and repetition."""

    timeout: float | None = None  # s, wall time of a trial
    recordings: Path | None = None  # folder for recordings; None means that they are not kept
    redo: bool = False  # True if trials that are already in the store are flown again


def complete(
    tasks: Sequence[Task],
    store: Store,
    backend: Backend,
    options: Options = Options(),
    heard: Heard = lambda task, row, fresh: None,
) -> list[Row]:
    """Rows of all tasks, in order: from the store, or flown now and added to it.

    Trials are flown again if they had failed, lack a metric that is asked for, or lack a recording that is to be kept.
    StoreError if a result cannot be written; earlier results stay in the store.
    """
    asked, kept = {task.key: set(task.metrics) for task in tasks}, options.recordings
    rows = {
        key: row
        for key, row in ({} if options.redo else store.done(tasks)).items()
        if asked[key] <= row.metrics.keys() and (kept is None or (kept / f"{key}.npz").exists())
    }
    store.label(tasks)
    for task in tasks:
        if task.key in rows:
            heard(task, rows[task.key], False)

    def keep(task: Task, flown: Flown) -> None:
        if kept is not None and flown.recording:
            _write(kept / f"{task.key}.npz", flown.recording)
        store.add(task, flown.row)
        rows[task.key] = flown.row
        heard(task, flown.row, True)

    _fly_all([task for task in tasks if task.key not in rows], backend, keep, options)
    return [rows[task.key] for task in tasks]


def rows_of(tasks: Sequence[Task], backend: Backend) -> list[Row]:
    """Fly all tasks and return their rows, in order, without a store."""
    rows: dict[str, Row] = {}
    _fly_all(tasks, backend, lambda task, flown: rows.update({task.key: flown.row}))
    return [rows[task.key] for task in tasks]


def _fly_all(
    tasks: Sequence[Task], backend: Backend, keep: Callable[[Task, Flown], None], options: Options = Options()
) -> None:
    """Fly tasks, and call `keep` for each one that is complete or has failed twice."""
    waiting = deque((task, 1) for task in tasks)
    flying: _Flying = {}
    ended: SimpleQueue[Future[Flown]] = SimpleQueue()
    try:
        while waiting or flying:
            while waiting and backend.room():
                future = _submitted(backend, waiting[0][0], options)
                flying[future] = waiting.popleft()
                future.add_done_callback(ended.put)
            for future in _over(ended, flying, backend, options.timeout):
                task, attempt = flying.pop(future)
                flown = _outcome(future, task, options.timeout)
                if not future.done():
                    backend.drop(future)
                if flown.row.status == "failed" and attempt < ATTEMPTS:
                    waiting.append((task, attempt + 1))
                else:
                    keep(task, flown)
    finally:
        for future in flying:
            future.cancel()


def _submitted(backend: Backend, task: Task, options: Options) -> Future[Flown]:
    try:
        return backend.submit(task, keep=options.recordings is not None, timeout=options.timeout)
    except Exception as error:  # the executor is broken, shut down or unreachable
        raise StoreError(f"no more trials can be flown: {type(error).__name__}: {error}") from error


def _over(
    ended: SimpleQueue[Future[Flown]], flying: _Flying, backend: Backend, timeout: float | None
) -> list[Future[Flown]]:
    """The next trial that ends, and those that hang; empty if nothing happens for `_TICK` seconds."""
    try:
        first = ended.get(timeout=_TICK)
    except Empty:
        first = None
    found = [first] if first in flying else []  # a trial that was given up before is ignored
    if timeout is not None:
        found += [future for future in backend.overdue(timeout + _GRACE) if future is not first and future in flying]
    return found


def _outcome(future: Future[Flown], task: Task, timeout: float | None) -> Flown:
    if not future.done():
        return failed(task, f"TimeoutError: hung for longer than the timeout of {timeout:g} s")
    try:
        return future.result()
    except Exception as error:
        return failed(task, f"{type(error).__name__}: the process that flew it died: {error}")


def _write(path: Path, content: bytes) -> None:
    try:
        path.parent.mkdir(exist_ok=True)
        with whole(path) as part:
            part.write_bytes(content)
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror}") from error
