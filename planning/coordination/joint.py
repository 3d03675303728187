"""Joint planning: one UAV decides for the whole team (centralised), or each UAV does so for itself (Dec-POMDP)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planning.coordination.decision import Decision, expected_plans
from planning.planner import Exchange, Plan, Situation
from tracking.numerics.arrays import Array


@dataclass(frozen=True)
class Decentralised:
    """Dec-POMDP as in [Li22] IV-E: each UAV optimises the joint plan on its own belief and flies its own share.

    No decisions are sent. All search with the same random numbers, agreed beforehand: equal beliefs, equal plans.
    A UAV takes the others' shares of its own joint plan for their intents.
    """

    exchange = Exchange(0)

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """As `Coordination.plans`."""
        seed = int(rng.integers(2**63))
        return [self._plan(s, _joint(s, decision, seed)) for s in team]

    @staticmethod
    def _plan(situation: Situation, joint: Array) -> Plan:
        """A UAV's share of its joint plan (n, H, 2) m/s, with those of the others."""
        shares = {v.id: plan for v, plan in zip(situation.vehicles, joint, strict=True)}
        return Plan(shares.pop(situation.own.id), shares)


@dataclass(frozen=True)
class Centralised:
    """One optimisation of the joint plan of all UAVs, on the belief of the first; radio links do not matter."""

    exchange = Exchange(centre=True)

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """As `Coordination.plans`."""
        first = team[0]
        intents = {i: plan for s in team for i, plan in s.intents.items() if i == s.own.id}
        centre = replace(first, neighbours=tuple(s.own for s in team[1:]), intents=intents)
        plans = _joint(centre, decision, int(rng.integers(2**63)))
        rows = {vehicle.id: row for row, vehicle in enumerate(centre.vehicles)}
        return [Plan(plans[rows[s.own.id]]) for s in team]


def _joint(situation: Situation, decision: Decision, seed: int) -> Array:
    """Joint plan (n, H, 2) m/s of all UAVs in a situation."""
    plans = expected_plans(situation, decision.horizon)
    return decision.decide(situation, plans, range(len(plans)), np.random.default_rng(seed))
