"""Flies the trials of a study on an executor, keeps each result as it comes and repeats failed trials once."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

from sim.mission.atomic_files import write_whole
from sim.study.store import Store, StoreError
from sim.study.trial_flight import TrialResult, fly_trial, make_failure
from sim.study.trials import StudyTrial, TrialRow

ATTEMPTS = 2
OnRow = Callable[[TrialRow, bool], None]  # a row, and whether it was flown just now


class _Attempt(NamedTuple):
    """An attempt to fly a trial."""

    trial: StudyTrial
    number: int


@dataclass(frozen=True)
class Options:
    """Options of a study: timeout, recordings and repetition."""

    timeout: float | None = None  # s, wall time of a trial
    recordings: Path | None = None  # folder for recordings; None means that they are not kept
    redo: bool = False  # True if trials that are already in the store are flown again


def complete(
    trials: Sequence[StudyTrial],
    store: Store,
    executor: Executor,
    options: Options = Options(),
    on_row: OnRow = lambda row, fresh: None,
) -> list[TrialRow]:
    """Rows of all trials, in order: from the store, or flown now and added to it.

    Trials are flown again if they had failed, lack a metric that is asked for, or lack a recording that is to be kept.

    Args:
        trials: Trials to complete.
        store: Store of their results.
        executor: Calls `fly_trial` for each trial that is missing.
        options: Timeout, recordings and repetition.
        on_row: Called with each row, from the store or flown.

    Raises:
        StoreError: If a result cannot be written or no more trials can be flown; earlier results stay in the store.
    """
    folder = options.recordings
    stored = {} if options.redo else store.read_finished_rows(trials)
    rows: dict[str, TrialRow] = {}
    store.label(trials)
    for trial in trials:
        row = stored.get(trial.key)
        recorded = folder is None or (folder / f"{trial.key}.npz").exists()
        if row and recorded and row.metrics.keys() >= set(trial.metrics):
            rows[trial.key] = row
            on_row(row, False)

    def keep(trial: StudyTrial, result: TrialResult) -> None:
        if folder is not None and result.recording:
            _write(folder / f"{trial.key}.npz", result.recording)
        store.add(trial, result.row)
        rows[trial.key] = result.row
        on_row(result.row, True)

    _fly_all([trial for trial in trials if trial.key not in rows], executor, keep, options)
    return [rows[trial.key] for trial in trials]


def fly_trials(trials: Sequence[StudyTrial], executor: Executor) -> list[TrialRow]:
    """Fly all trials and return their rows, in order, without a store."""
    rows: dict[str, TrialRow] = {}
    _fly_all(trials, executor, lambda trial, result: rows.update({trial.key: result.row}), Options())
    return [rows[trial.key] for trial in trials]


def _fly_all(
    trials: Sequence[StudyTrial],
    executor: Executor,
    keep: Callable[[StudyTrial, TrialResult], None],
    options: Options,
) -> None:
    """Fly trials, and call `keep` for each one that is complete or has failed twice."""
    flying: dict[Future[TrialResult], _Attempt] = {}
    ended: SimpleQueue[Future[TrialResult]] = SimpleQueue()

    def submit(attempt: _Attempt) -> None:
        kept = options.recordings is not None
        try:
            future = executor.submit(fly_trial, attempt.trial, keep=kept, timeout=options.timeout)
        except Exception as error:  # the executor is broken, shut down or unreachable
            raise StoreError(f"no more trials can be flown: {type(error).__name__}: {error}") from error
        flying[future] = attempt
        future.add_done_callback(ended.put)

    try:
        for trial in trials:
            submit(_Attempt(trial, 1))
        while flying:
            future = ended.get()
            if future.cancelled():  # not by us: the executor is lost, which is not the trial's fault
                raise StoreError("no more trials can be flown: their executor has cancelled them")
            trial, number = flying.pop(future)
            error = future.exception()
            result = make_failure(trial, f"{type(error).__name__}: {error}") if error else future.result()
            if result.row.status == "failed" and number < ATTEMPTS:
                submit(_Attempt(trial, number + 1))
            else:
                keep(trial, result)
    finally:
        for future in flying:
            future.cancel()


def _write(path: Path, content: bytes) -> None:
    try:
        path.parent.mkdir(exist_ok=True)
        with write_whole(path) as part:
            part.write_bytes(content)
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror}") from error
