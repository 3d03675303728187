"""Short studies and made-up results for tests of comparisons."""

import math
import sqlite3
import time
from concurrent.futures import Future
from contextlib import closing

import msgspec
import numpy as np

from sim.study.backends import Backend
from sim.study.store import NAME, Store
from sim.study.study import Study
from sim.study.tasks import Task, get_release, list_tasks
from sim.study.trial_flight import TrialResult, fly_trial, make_failure

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
    return list_tasks(Study(name="short", planners=tuple(planners), seeds=seeds, settings=SHORT, **changes))


def task_of(setting, planner, seed):
    """A trial by itself, of no study."""
    return Task(key=f"{planner} {seed}", setting=setting, planner=planner, seed=seed, version=get_release())


def invented(task):
    """A row as a flight gives it, its numbers drawn by the seed."""
    rng = np.random.default_rng([task.seed, task.repeat] if task.repeat else task.seed)
    row = make_failure(task, "").row
    values = dict(zip(NUMBERS, rng.uniform(size=len(NUMBERS)).tolist(), strict=True))
    return msgspec.structs.replace(
        row,
        status="done",
        metrics={**values, "detection.precision": math.nan},
        ospa=rng.uniform(size=6).astype(np.float32),
        times=np.arange(6) / 5,
    )


def store(folder, tasks):
    """Fill the store in a folder with invented rows of tasks of one study; these rows."""
    rows = [invented(task) for task in tasks]
    with Store.open(folder, tasks[0].study) as opened:
        for task, row in zip(tasks, rows, strict=True):
            opened.add(task, row)
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


class Serial(Backend):
    """Flies at once, or does to a trial what `fates` says of its planner, attempt by attempt.

    None stands for an invented row, a text for a row that failed, an exception for one that its future has, its class
    for one that is raised at once, and `...` for a future that never ends.
    """

    def __init__(self, fates=None):
        self.fates = {name: list(fate) for name, fate in (fates or {}).items()}
        self.flown = []
        self._begun = {}  # s, by future

    def submit(self, task, *, keep, timeout):
        self.flown.append((task.planner, task.seed))
        future = Future()
        self._begun[future] = time.monotonic()
        fate = self.fates[task.planner].pop(0) if self.fates.get(task.planner) else None
        if isinstance(fate, type):
            raise fate
        if isinstance(fate, str):
            future.set_result(make_failure(task, fate))
        elif isinstance(fate, BaseException):
            future.set_exception(fate)
        elif fate is None:
            future.set_result(fly_trial(task, keep=keep) if not self.fates else TrialResult(invented(task)))
        return future

    def end_hanging(self, seconds):
        late = [f for f, begun in self._begun.items() if not f.done() and time.monotonic() - begun > seconds]
        for future in late:
            future.cancel()
        return late


def is_timing(metric):
    """True if a metric depends on the machine and its load, and so differs from flight to flight of one trial."""
    return metric.startswith(("seconds.", "planning_")) or metric in ("wall_s", "real_time_factor")
