"""Rewards of one UAV at a decision, from its belief or, for training only, from ground truth."""

import math
from collections.abc import Callable, Mapping

import numpy as np

from planning.planner import Situation
from sim.facts.metrics.holding import FAR
from sim.mission.plan_check import copy_situation
from sim.mission.snapshot import find_reported_positions
from tracking.errors import check_known
from tracking.metrics.ospa import gospa
from tracking.metrics.squared_error import cut_off
from tracking.numerics.arrays import Array
from tracking.track import beliefs_of

Reward = Callable[[Situation, Array], float]  # a function of a situation and the true positions (M, 2) m of people


def compute_expected_gospa(situation: Situation, people: Array) -> float:
    """Negative root of the expected square of GOSPA [m] under the UAV's own belief, with cut-off c = 10 m.

    A reported track adds r e + (1 - r) c² / 2, where r is its existence probability and e the expected squared error of
    its position, cut off at c² (`cut_off`). Any other track adds r c² / 2, and each expected undetected person c² / 2.
    Tracks are assumed to be far apart; ground truth is not used. Source: [GarciaFernandez21].
    """
    _, covariances = beliefs_of(situation.tracks)
    errors = covariances[:, 0, 0] + covariances[:, 1, 1]
    cut_off(errors, FAR)
    r = np.array([track.existence for track in situation.tracks])
    undetected = 0.0 if situation.undetected is None else float(situation.undetected.people.sum())
    missed = FAR * FAR / 2
    reported = [track.reported for track in situation.tracks]
    costs = np.where(reported, r * errors + (1.0 - r) * missed, r * missed)
    return -math.sqrt(float(costs.sum()) + undetected * missed)


def compute_true_gospa(situation: Situation, people: Array) -> float:
    """Negative GOSPA [m] between the UAV's reported tracks and the true people, cut-off 10 m; for training only."""
    return -gospa(find_reported_positions(situation.tracks), people, FAR).distance


def trace(situation: Situation, people: Array) -> float:
    """Negative sum of the position variances [m²] of the UAV's tracks, which [Li22] minimises; without ground truth.

    Note: the largest value, 0, is reached without any tracks; a person no longer counts after the end of the track.
    """
    _, covariances = beliefs_of(situation.tracks)
    return -float((covariances[:, 0, 0] + covariances[:, 1, 1]).sum())


REWARDS: Mapping[str, Reward] = {"gospa": compute_expected_gospa, "true_gospa": compute_true_gospa, "trace": trace}
ON_BELIEF = ("gospa", "trace")  # rewards without ground truth; all others are for training only


def find_reward(given: str | Reward) -> Reward:
    """The reward with this key, or the given function; InputError for an unknown key."""
    if callable(given):
        return lambda situation, people: given(copy_situation(situation), people)
    check_known("reward", str(given), REWARDS, " (or a function of situation and true people)")
    return REWARDS[given]
