"""A decision on plans of some UAVs, which coordination schemes put in order."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from planning.planner import Situation
from tracking.numerics.arrays import Array


class Decision(Protocol):
    """Optimises plans of some UAVs on one UAV's belief."""

    @property
    def horizon(self) -> int:
        """Steps of a plan."""

    def decide(self, situation: Situation, controls: Array, uavs: Sequence[int], rng: np.random.Generator) -> Array:
        """Plans (k, H, 2) m/s of the UAVs in rows `uavs` of `situation.vehicles` if others fly `controls` (n, H, 2)."""


def own_plan(situation: Situation, plans: Array, decision: Decision, rng: np.random.Generator) -> Array:
    """Plan (H, 2) m/s of the UAV itself, if others fly `plans` (n, H, 2) m/s."""
    return np.asarray(decision.decide(situation, plans, [situation.vehicles.index(situation.own)], rng)[0])
