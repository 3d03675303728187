"""Missions side by side: planners on the same forests, people and seeds, on any executor."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import dataclass

import numpy as np

from sim.mission import Mission, Trial
from sim.radio import disagreement
from sim.scenario import Scenario


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
    sees_truth: bool = False  # whether the planner does: an upper bound
    plan_bytes: int = 0  # sent by the whole team, of plans


def fly(trial: Trial) -> Outcome:
    """Fly one trial, keeping nothing but its outcome."""
    mission = Mission.of(trial)
    errors, gaps, told = [], [], 0
    for snapshot in mission.fly():
        errors.append(snapshot.ospa[snapshot.working, 0])
        gaps.append(disagreement([snapshot.tracks[i] for i in snapshot.working]))
        told += int(snapshot.plan_bytes.sum())
    distance = np.concatenate(errors)
    return Outcome(
        planner=trial.planner,
        seed=trial.seed,
        mean_m=float(distance.mean()),
        median_m=float(np.median(distance)),
        share_under_1m=float(np.mean(distance < 1.0)),
        planning_s=mission.clock.seconds["planning"],
        faults=len(mission.faults),
        disagreement_m=float(np.mean(gaps)),
        sees_truth=mission.sees_truth,
        plan_bytes=told,
    )


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
    # One BLAS thread per worker: the variables are read when a worker imports NumPy.
    os.environ.update({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
    # Ctrl-C reaches the workers too: they end at once and say nothing, as the parent does the talking.
    end = (signal.SIGINT, signal.SIG_DFL)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=signal.signal, initargs=end) as executor:
        return fly_all(trials, executor, progress)


def fly_all(
    trials: Sequence[Trial], executor: Executor, progress: Callable[[Outcome], None] = lambda outcome: None
) -> list[Outcome]:
    """Outcomes in the order of the trials; `progress` hears of each as it comes."""
    futures = [executor.submit(fly, trial) for trial in trials]
    try:
        for future in as_completed(futures):
            progress(future.result())
    finally:
        for future in futures:
            future.cancel()
    return [future.result() for future in futures]
