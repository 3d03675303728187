"""Plans worth trying in any situation: where optimisers start from besides the policy of intent."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from planning.optimizers import limited
from planning.planner import Vehicle
from planning.view import MARKS, shown_at
from tracking.compiled import Array

NEAREST = 6  # targets that a UAV considers pursuing


def pursuits(nominal: Array, vehicle: Vehicle, step: float) -> Array:
    """Plans (S, H, 2) m/s that hover, or chase one near target or the middle of two at full speed.

    nominal (H, T, 2) m: where targets are after each step of `step` s.
    """
    position, spots = vehicle.position[:2], shown_at(vehicle, MARKS)
    near = np.argsort(np.linalg.norm(nominal[0] - position - spots[0], axis=1), kind="stable")[:NEAREST]
    goals = [nominal[:, t] - spot for t in near for spot in spots]
    goals += [(nominal[:, a] + nominal[:, b]) / 2 - spots[0] for a, b in combinations(near, 2)]
    goals.append(np.tile(position, (len(nominal), 1)))
    reached = np.tile(position, (len(goals), 1))
    plans = np.empty((len(goals), len(nominal), 2))
    for k, goal in enumerate(np.stack(goals, axis=1)):
        plans[:, k] = limited(((goal - reached) / step)[:, None], vehicle.max_speed)[:, 0]
        reached = reached + step * plans[:, k]
    return plans
