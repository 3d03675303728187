"""The interface of optimisers over the plans of one or more UAVs, and initial plans for them."""

from functools import cache
from itertools import combinations
from typing import Protocol

import numpy as np

from planning.objective.terms import Objective
from planning.planner import Vehicle, limit_speed
from planning.prediction.field_of_view import IMAGE_POINTS, points_shown
from planning.prediction.targets_in_reach import TargetsInReach
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.trigonometry import cos_each, sin_each


class Optimizer(Protocol):
    """Searches for plans of k UAVs; the result is never worse than the best start.

    Example:
        ```python
        class BestStart:
            def minimise(self, objective, starts, max_speeds, rng, in_reach=None):
                return starts[objective(starts).argmin()]
        ```
    """

    def minimise(
        self,
        objective: Objective,
        starts: Array,
        max_speeds: Array,
        rng: np.random.Generator,
        in_reach: TargetsInReach | None = None,
    ) -> Array:
        """The best plans (k, H, 2) m/s that are found.

        If targets in reach are given, the objective also takes the argument `ease`; an optimiser may ignore both.
        starts (S, k, H, 2) m/s; max_speeds (k,) m/s; rng: the only source of random numbers.
        """


NEAREST = 6  # number of nearest targets for which `make_pursuits` makes plans
HEADINGS = 16


def make_pursuits(nominal: Array, vehicle: Vehicle, step: float) -> Array:
    """Plans (S, H, 2) m/s that hover, or pursue at full speed one near target or the midpoint of two.

    nominal (H, T, 2) m: positions of targets after each step of `step` s.
    """
    position, spots = vehicle.position[:2], points_shown(vehicle, IMAGE_POINTS)
    near = nominal[:, np.argsort(length(nominal[0] - position - spots[0]), kind="stable")[:NEAREST]]
    steps, count = near.shape[:2]
    first, second = np.array(list(combinations(range(count), 2)), dtype=np.int64).reshape(-1, 2).T
    each = (near[:, :, None] - spots).reshape(steps, -1, 2)
    between = (near[:, first] + near[:, second]) / 2 - spots[0]
    goals = np.concatenate([each, between, np.tile(position, (steps, 1, 1))], axis=1)
    reached = np.tile(position, (goals.shape[1], 1))
    plans = np.empty((goals.shape[1], steps, 2))
    for k, goal in enumerate(goals):
        plans[:, k] = limit_speed((goal - reached) / step, vehicle.max_speed)
        reached = reached + step * plans[:, k]
    return plans


@cache
def make_turns(max_speed: float, horizon: int) -> Array:
    """Plans (S, H, 2) m/s of two legs, each at full speed in one of 16 directions, or hovering."""
    angles = 2 * np.pi * np.arange(HEADINGS) / HEADINGS
    controls = np.concatenate([max_speed * np.column_stack([cos_each(angles), sin_each(angles)]), np.zeros((1, 2))])
    first = horizon // 2
    before = controls if first else controls[:1]  # a plan of one step has no first leg
    return np.array([[a] * first + [b] * (horizon - first) for a in before for b in controls])
