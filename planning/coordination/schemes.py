"""Coordination schemes: sequential (SMA), parallel (PMA), Dec-POMDP and centralised planning."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from planning.coordination.decision import Decider, decide_own_plan
from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import BASE_RANGE, expect_plans
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length

Order = Literal["fixed", "random", "worst-first"]


@dataclass(frozen=True)
class Sequential:
    """UAVs decide one after another; each knows the plans of the UAVs before it, [Li22] Algorithm 3.

    A UAV expects the UAVs after it to follow their policy of intent or, from the second sweep on, their last plans. It
    expects the same of UAVs before it whose plans do not reach it. A plan is sent once and not forwarded.
    """

    order: Order = "fixed"
    sweeps: int = 1

    @property
    def exchange(self) -> Exchange:
        """As `planning.coordination.decision.Coordination.exchange`."""
        return Exchange(self.sweeps)

    @property
    def decentralised(self) -> bool:
        """False for the order "worst-first", which compares beliefs."""
        return self.order != "worst-first"

    def make_plans(self, team: Sequence[Situation], decider: Decider, rng: np.random.Generator) -> list[Plan]:
        """As `planning.coordination.decision.Coordination.make_plans`."""
        known: dict[int, dict[int, Array]] = {s.own.id: {} for s in team}  # plans by holder and author
        sequence = self._order_team(team, rng)
        for sweep in range(self.sweeps):
            for situation in sequence:
                sender = situation.own.id
                plans = expect_plans(situation, decider.horizon, known[sender])
                plan = decide_own_plan(situation, plans, decider, rng)
                for s in team:
                    if s.own.id == sender or s.receives(sender, sweep):
                        known[s.own.id][sender] = plan
        return [Plan(known[s.own.id][s.own.id]) for s in team]

    def _order_team(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Situation]:
        if self.order == "random":
            return [team[k] for k in rng.permutation(len(team))]
        if self.order == "worst-first":
            return sorted(team, key=_find_largest_trace, reverse=True)
        return list(team)


def _find_largest_trace(situation: Situation) -> float:
    near = [
        float(np.trace(t.belief.covariance[:2, :2]))
        for t in situation.tracks
        if length(t.belief.mean[:2] - situation.own.position[:2]) <= BASE_RANGE
    ]
    return max(near, default=0.0)


@dataclass(frozen=True)
class Parallel:
    """All UAVs decide at once and then send their plans; each expects the others to follow their policy of intent."""

    exchange = Exchange()
    decentralised = True

    def make_plans(self, team: Sequence[Situation], decider: Decider, rng: np.random.Generator) -> list[Plan]:
        """As `planning.coordination.decision.Coordination.make_plans`."""
        return [Plan(decide_own_plan(s, expect_plans(s, decider.horizon), decider, rng)) for s in team]


@dataclass(frozen=True)
class Decentralised:
    """Dec-POMDP as in [Li22] IV-E: each UAV optimises the joint plan on its own belief and flies its own share.

    No plans are sent. All UAVs search with the same random numbers, agreed beforehand, so that equal beliefs give equal
    plans. A UAV takes the shares of the others in its own joint plan as their intents.
    """

    exchange = Exchange(0)
    decentralised = True

    def make_plans(self, team: Sequence[Situation], decider: Decider, rng: np.random.Generator) -> list[Plan]:
        """As `planning.coordination.decision.Coordination.make_plans`."""
        seed = int(rng.integers(2**63))
        plans = []
        for s in team:
            shares = _plan_jointly(s, decider, seed)
            plans.append(Plan(shares.pop(s.own.id), shares))
        return plans


@dataclass(frozen=True)
class Centralised:
    """One optimisation of the joint plan of all UAVs, on the belief of the first; radio links do not matter."""

    exchange = Exchange(centre=True)
    decentralised = False

    def make_plans(self, team: Sequence[Situation], decider: Decider, rng: np.random.Generator) -> list[Plan]:
        """As `planning.coordination.decision.Coordination.make_plans`."""
        if not team:
            return []
        first = team[0]
        intents = {i: plan for s in team for i, plan in s.intents.items() if i == s.own.id}
        centre = replace(first, neighbours=tuple(s.own for s in team[1:]), intents=intents)
        plans = _plan_jointly(centre, decider, int(rng.integers(2**63)))
        return [Plan(plans[s.own.id]) for s in team]


def _plan_jointly(situation: Situation, decider: Decider, seed: int) -> dict[int, Array]:
    """Joint plan of all UAVs in a situation: the share (H, 2) m/s of each, by id."""
    plans = expect_plans(situation, decider.horizon)
    found = decider.decide(situation, plans, range(len(plans)), np.random.default_rng(seed))
    return {v.id: plan for v, plan in zip(situation.vehicles, found, strict=True)}
