"""Flies trials on any executor, keeps each result as it comes, and gives what fails a second chance."""

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
_TICK = 0.5  # s, between looks at what has started and what hangs
_GRACE = 2.0  # s beyond the timeout, in which a trial that is merely slow ends by itself
_Flying = dict[Future[Flown], tuple[Task, int]]  # trials with the number of the attempt
Heard = Callable[[Task, Row, bool], None]  # a task, its row, and whether it was flown just now


@dataclass(frozen=True)
class Options:
    """Options of a study: timeout, recordings, flying again."""

    timeout: float | None = None  # s of wall time for a trial
    recordings: Path | None = None  # folder in which they are kept
    redo: bool = False  # whether trials that are there already are flown again


def complete(
    tasks: Sequence[Task],
    store: Store,
    backend: Backend,
    options: Options = Options(),
    heard: Heard = lambda task, row, fresh: None,
) -> list[Row]:
    """Rows of all tasks, in order: those in the store, the rest flown now and kept. What had failed is tried again.

    A trial without a metric that was asked for counts as missing; so does one without a recording that is to be kept.

    StoreError where a result cannot be kept; those before are.
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
    """Rows of all tasks, in order, kept nowhere."""
    rows: dict[str, Row] = {}
    _fly_all(tasks, backend, lambda task, flown: rows.update({task.key: flown.row}))
    return [rows[task.key] for task in tasks]


def _fly_all(
    tasks: Sequence[Task], backend: Backend, keep: Callable[[Task, Flown], None], options: Options = Options()
) -> None:
    """Fly tasks; `keep` hears of each that is complete, or has failed for the second time."""
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
    except Exception as error:  # of an executor that is broken, shut down or out of reach
        raise StoreError(f"no more trials can be flown: {type(error).__name__}: {error}") from error


def _over(
    ended: SimpleQueue[Future[Flown]], flying: _Flying, backend: Backend, timeout: float | None
) -> list[Future[Flown]]:
    """The next flight to end, and those that hang; none if nothing happens for a while."""
    try:
        first = ended.get(timeout=_TICK)
    except Empty:
        first = None
    found = [first] if first in flying else []  # not if it was given up before
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
