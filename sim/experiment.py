"""Missions side by side, kept nowhere: planners on the same forests, people and seeds, on any executor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from sim.errors import InputError
from sim.mission import Trial
from sim.scenario import Scenario
from sim.study import trial as study
from sim.study.engine import Backend, Borrowed
from sim.study.engine import fly_all as complete
from sim.study.pool import Pool
from sim.study.row import Row
from sim.study.tasks import Task, task_of


@dataclass(frozen=True)
class Outcome:
    """What a trial came to."""

    planner: str
    seed: int
    mean_m: float  # OSPA over all pairs of scan and UAV that works
    median_m: float
    share_under_1m: float
    planning_s: float  # wall time of all decisions
    faults: int
    disagreement_m: float  # between the UAVs' tracks, see `sim.radio.disagreement`; mean over the scans


def fly(trial: Trial) -> Outcome:
    """Fly one trial, keeping nothing but its outcome."""
    return _outcome(study.fly(task_of(trial.scenario, trial.planner, trial.seed)).row)


def compare(
    scenario: Scenario,
    planners: Sequence[str],
    seeds: Sequence[int],
    *,
    workers: int = 1,
    progress: Callable[[Outcome], None] = lambda outcome: None,
) -> list[Outcome]:
    """Outcomes of every planner on every seed, planner by planner, flown by `workers` processes."""
    return fly_apart([Trial(scenario, planner, seed) for planner in planners for seed in seeds], workers, progress)


def fly_apart(
    trials: Sequence[Trial], workers: int, progress: Callable[[Outcome], None] = lambda outcome: None
) -> list[Outcome]:
    """Outcomes in the order of the trials, flown by `workers` processes."""
    with Pool(workers) as pool:
        return _fly_all(trials, pool, progress)


def fly_all(
    trials: Sequence[Trial], executor: Executor, progress: Callable[[Outcome], None] = lambda outcome: None
) -> list[Outcome]:
    """Outcomes in the order of the trials; `progress` hears of each as it comes."""
    return _fly_all(trials, Borrowed(executor), progress)


def _fly_all(trials: Sequence[Trial], backend: Backend, progress: Callable[[Outcome], None]) -> list[Outcome]:
    tasks = [task_of(trial.scenario, trial.planner, trial.seed) for trial in trials]
    found: dict[str, Outcome] = {}

    def keep(task: Task, flown: study.Flown) -> None:
        found[task.key] = _outcome(flown.row)
        progress(found[task.key])

    complete(tasks, backend, keep)
    return [found[task.key] for task in tasks]


def _outcome(row: Row) -> Outcome:
    """The outcome of a row; InputError or RuntimeError if the trial failed."""
    kind, _, reason = row.error.partition(": ")
    if row.status == "failed":
        raise InputError(reason) if kind == "InputError" else RuntimeError(row.error)
    found = row.metrics
    return Outcome(
        planner=row.planner,
        seed=row.seed,
        mean_m=found["ospa.mean_m"],
        median_m=found["ospa.median_m"],
        share_under_1m=found["ospa.share_under_1m"],
        planning_s=found["seconds.planning"],
        faults=int(found["faults"]),
        disagreement_m=found["disagreement_m"],
    )
