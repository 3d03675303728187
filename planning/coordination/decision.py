"""The interfaces of coordination schemes and of the decisions that they put in order."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from planning.planner import Exchange, Plan, Situation
from tracking.numerics.arrays import Array


class Decider(Protocol):
    """Optimises plans of some UAVs on one UAV's belief.

    Example:
        ```python
        class AsExpected:
            horizon = 5

            def decide(self, situation, controls, uavs, rng):
                return controls[list(uavs)]
        ```
    """

    @property
    def horizon(self) -> int:
        """Steps of a plan."""

    def decide(self, situation: Situation, controls: Array, uavs: Sequence[int], rng: np.random.Generator) -> Array:
        """Plans (k, H, 2) m/s of the UAVs in rows `uavs` of `situation.vehicles`, if the others fly their `controls`.

        controls (n, H, 2) has a row for every UAV; those of `uavs` are starting values.
        """


class Coordination(Protocol):
    """Makes a team's plans out of decisions.

    Example:
        ```python
        from understory import Exchange, Plan, decide_own_plan, expect_plans

        class Parallel:
            exchange = Exchange()
            decentralised = True

            def make_plans(self, team, decider, rng):
                expected = [expect_plans(situation, decider.horizon) for situation in team]
                pairs = zip(team, expected, strict=True)
                return [Plan(decide_own_plan(situation, plans, decider, rng)) for situation, plans in pairs]
        ```
    """

    @property
    def exchange(self) -> Exchange:
        """Plans that the UAVs send at each decision."""

    @property
    def decentralised(self) -> bool:
        """True if a UAV's plan depends only on its own situation and on plans that it receives."""

    def make_plans(self, team: Sequence[Situation], decider: Decider, rng: np.random.Generator) -> list[Plan]:
        """The plan of each UAV, in the team's order."""


def decide_own_plan(situation: Situation, plans: Array, decider: Decider, rng: np.random.Generator) -> Array:
    """Plan (H, 2) m/s of the UAV itself, if others fly `plans` (n, H, 2) m/s."""
    return np.asarray(decider.decide(situation, plans, [situation.vehicles.index(situation.own)], rng)[0])
