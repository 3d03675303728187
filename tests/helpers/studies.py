"""Short studies and made-up results for tests of comparisons."""

import math
import sqlite3
from concurrent.futures import Executor, Future
from contextlib import closing

import msgspec
import numpy as np

from sim.study.definition import Study
from sim.study.store import NAME, Store
from sim.study.trial_flight import TrialResult, make_failure
from sim.study.trials import StudyTrial, get_release, list_trials

NUMBERS = (
    "ospa.mean_m",
    "ospa.median_m",
    "ospa.share_under_1m",
    "detection.recall",
    "wall_s",
    "seconds.planning",
    "faults",
)
SHORT = {"duration": "1", "sensing.mode": "ideal", "trees.density": "5"}


def short(planners=("hover", "greedy"), seeds="0-1", **changes):
    """Trials of a second."""
    return list_trials(Study(name="short", planners=tuple(planners), seeds=seeds, settings=SHORT, **changes))


def task_of(setting, planner, seed):
    """A trial by itself, of no study."""
    return StudyTrial(key=f"{planner} {seed}", setting=setting, planner=planner, seed=seed, version=get_release())


def invented(trial):
    """A row as a flight gives it, its numbers drawn by the seed."""
    rng = np.random.default_rng([trial.seed, trial.repeat] if trial.repeat else trial.seed)
    row = make_failure(trial, "").row
    values = dict(zip(NUMBERS, rng.uniform(size=len(NUMBERS)).tolist(), strict=True))
    return msgspec.structs.replace(
        row,
        status="done",
        metrics={**values, "detection.precision": math.nan},
        ospa=rng.uniform(size=6).astype(np.float32),
        times=np.arange(6) / 5,
    )


def store(folder, trials):
    """Fill the store in a folder with invented rows of trials of one study; these rows."""
    rows = [invented(trial) for trial in trials]
    with Store.open(folder, trials[0].study) as opened:
        for trial, row in zip(trials, rows, strict=True):
            opened.add(trial, row)
    return rows


def sql(folder, statement):
    """Rows that a statement of SQL gives of the store in a folder, which keeps what it changes."""
    with closing(sqlite3.connect(folder / NAME)) as connection, connection:
        return connection.execute(statement).fetchall()


def plain(row):
    """A row as values that compare, what depends on the machine left out."""
    metrics = {name: repr(value) for name, value in row.metrics.items() if not is_timing(name)}
    names = ("study", "scenario", "factors", "planner", "seed", "repeat", "version", "status", "error", "settings")
    fixed = tuple(getattr(row, name) for name in names)
    return *fixed, metrics, row.ospa.dtype.str, row.ospa.tobytes(), row.times.tobytes()


class Serial(Executor):
    """Flies at once, or does to a trial what `fates` says of its planner, attempt by attempt.

    None stands for an invented row, a text for a row that failed, an exception for one that its future has, and its
    class for one that is raised at once.
    """

    def __init__(self, fates=None):
        self.fates = {name: list(fate) for name, fate in (fates or {}).items()}
        self.flown = []

    def submit(self, work, trial, /, **named):
        self.flown.append((trial.planner, trial.seed))
        future = Future()
        fate = self.fates[trial.planner].pop(0) if self.fates.get(trial.planner) else None
        if isinstance(fate, type):
            raise fate
        if isinstance(fate, str):
            future.set_result(make_failure(trial, fate))
        elif isinstance(fate, BaseException):
            future.set_exception(fate)
        else:
            future.set_result(TrialResult(invented(trial)) if self.fates else work(trial, **named))
        return future


def is_timing(metric):
    """True if a metric depends on the machine and its load, and so differs from flight to flight of one trial."""
    return metric.startswith(("seconds.", "planning_")) or metric in ("wall_s", "real_time_factor")
