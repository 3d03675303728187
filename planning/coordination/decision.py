"""Interfaces of decisions and of coordination, and the plans that UAVs expect of each other."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import policy_of_intent
from tracking.numerics.arrays import Array


class Decision(Protocol):
    """Optimises plans of some UAVs on one UAV's belief."""

    @property
    def horizon(self) -> int:
        """Steps of a plan."""

    def decide(self, situation: Situation, controls: Array, uavs: Sequence[int], rng: np.random.Generator) -> Array:
        """Plans (k, H, 2) m/s of the UAVs in rows `uavs` of `situation.vehicles` if others fly `controls` (n, H, 2)."""


class Coordination(Protocol):
    """Makes a team's plans out of decisions."""

    @property
    def exchange(self) -> Exchange:
        """Plans that the UAVs send at each decision."""

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """The plan of each UAV, in the team's order."""


def expected_plans(situation: Situation, horizon: int, decided: dict[int, Array] | None = None) -> Array:
    """Plans (n, H, 2) m/s of all UAVs: decided ones, else their policies of intent."""
    known = decided or {}
    return np.array(
        [known[v.id] if v.id in known else policy_of_intent(situation, v, horizon) for v in situation.vehicles]
    )


def own_row(situation: Situation) -> int:
    """Row of the UAV itself in `situation.vehicles`."""
    return situation.vehicles.index(situation.own)
