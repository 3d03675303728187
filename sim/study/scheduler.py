"""Flies the trials of a study on a backend, keeps each result as it comes and repeats failed trials once."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Future, TimeoutError
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import NamedTuple

from sim.mission.atomic_files import write_whole
from sim.processes.workers import describe_end
from sim.study.backends import GRACE, Backend
from sim.study.store import Store, StoreError
from sim.study.tasks import Row, Task
from sim.study.trial_flight import TrialResult, make_failure

ATTEMPTS = 2
_TICK = 0.5  # s, interval of checks for trials that hang
OnWait = Callable[[str], None]  # what trials wait for, empty if nothing
OnRow = Callable[[Task, Row, bool], None]  # a task, its row, and whether it was flown just now


class _Attempt(NamedTuple):
    """An attempt to fly a trial."""

    task: Task
    number: int


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
    on_row: OnRow = lambda task, row, fresh: None,
    on_wait: OnWait = lambda why: None,
) -> list[Row]:
    """Rows of all tasks, in order: from the store, or flown now and added to it.

    Trials are flown again if they had failed, lack a metric that is asked for, or lack a recording that is to be kept.
    StoreError if a result cannot be written or no more trials can be flown; earlier results stay in the store.
    """
    asked = {task.key: set(task.metrics) for task in tasks}
    kept = options.recordings
    rows = {
        key: row
        for key, row in ({} if options.redo else store.read_finished_rows(tasks)).items()
        if asked[key] <= row.metrics.keys() and (kept is None or (kept / f"{key}.npz").exists())
    }
    store.label(tasks)
    for task in tasks:
        if task.key in rows:
            on_row(task, rows[task.key], False)

    def keep(task: Task, result: TrialResult) -> None:
        if kept is not None and result.recording:
            _write(kept / f"{task.key}.npz", result.recording)
        store.add(task, result.row)
        rows[task.key] = result.row
        on_row(task, result.row, True)

    _fly_all([task for task in tasks if task.key not in rows], backend, keep, options, on_wait)
    return [rows[task.key] for task in tasks]


def fly_tasks(tasks: Sequence[Task], backend: Backend) -> list[Row]:
    """Fly all tasks and return their rows, in order, without a store."""
    rows: dict[str, Row] = {}
    _fly_all(tasks, backend, lambda task, result: rows.update({task.key: result.row}))
    return [rows[task.key] for task in tasks]


def _fly_all(
    tasks: Sequence[Task],
    backend: Backend,
    keep: Callable[[Task, TrialResult], None],
    options: Options = Options(),
    on_wait: OnWait = lambda why: None,
) -> None:
    """Fly tasks, and call `keep` for each one that is complete or has failed twice."""
    flying: dict[Future[TrialResult], _Attempt] = {}
    ended: SimpleQueue[Future[TrialResult]] = SimpleQueue()

    def submit(attempt: _Attempt) -> None:
        try:
            future = backend.submit(attempt.task, keep=options.recordings is not None, timeout=options.timeout)
        except Exception as error:  # the executor is broken, shut down or unreachable
            raise StoreError(f"no more trials can be flown: {type(error).__name__}: {error}") from error
        flying[future] = attempt
        future.add_done_callback(ended.put)

    try:
        for task in tasks:
            submit(_Attempt(task, 1))
        while flying:
            for future, error in _wait_for_ended(ended, backend, options.timeout, on_wait):
                if future not in flying:  # it was ended as it hung
                    continue
                if error and (loss := backend.describe_loss()):  # of which the trial is not to blame
                    raise StoreError(loss)
                task, number = flying.pop(future)
                result = _describe(task, error, backend, options.timeout) if error else future.result()
                if result.row.status == "failed" and number < ATTEMPTS:
                    submit(_Attempt(task, number + 1))
                else:
                    keep(task, result)
    finally:
        for future in flying:
            future.cancel()


def _wait_for_ended(
    ended: SimpleQueue[Future[TrialResult]], backend: Backend, timeout: float | None, on_wait: OnWait
) -> Iterator[tuple[Future[TrialResult], BaseException | None]]:
    """The next trial that ends, if one does within `_TICK` s, with its exception, and the trials that the backend ends.

    Only a cluster ends trials here that hang; the processes of `Pool` end by themselves at the timeout.
    """
    try:
        future = ended.get(timeout=_TICK)
    except Empty:
        on_wait(backend.describe_wait())
    else:
        yield future, CancelledError() if future.cancelled() else future.exception()
    if timeout is not None:
        for future in backend.end_hanging(timeout + GRACE):
            yield future, TimeoutError()


def _describe(task: Task, error: BaseException, backend: Backend, timeout: float | None) -> TrialResult:
    """The failure of a trial that ended with an exception."""
    text = f"{type(error).__name__}: {describe_end(error, timeout)}{backend.find_crash_place(task)}"
    return make_failure(task, text)


def _write(path: Path, content: bytes) -> None:
    try:
        path.parent.mkdir(exist_ok=True)
        with write_whole(path) as part:
            part.write_bytes(content)
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror}") from error
