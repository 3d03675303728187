"""Which UAV decides what, knowing what of the others: from single decisions to the team's plans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import BASE_RANGE, policy_of_intent
from tracking.numerics.compiled import Array
from tracking.numerics.matrices import length

Order = Literal["fixed", "random", "worst-first"]


class Decision(Protocol):
    """Optimises plans of some UAVs on one UAV's belief."""

    @property
    def horizon(self) -> int:
        """Steps of a plan."""
        ...

    def decide(self, situation: Situation, controls: Array, uavs: Sequence[int], rng: np.random.Generator) -> Array:
        """Plans (k, H, 2) m/s of the UAVs in rows `uavs` of `situation.vehicles` if others fly `controls` (n, H, 2)."""
        ...


class Coordination(Protocol):
    """Makes a team's plans out of decisions."""

    @property
    def exchange(self) -> Exchange:
        """What the UAVs send at each decision."""
        ...

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """The plan of each UAV, in the team's order."""
        ...


@dataclass(frozen=True)
class Sequential:
    """Sequential multi-agent planning (SMA), [Li22] Algorithm 3: each UAV knows the plans of those before it.

    Those after it are expected to follow their policy of intent or, in a second sweep, the plan they have made; and
    so are those before it whose plans do not reach it. A plan is sent to those that hear the sender, and no further.
    """

    order: Order = "fixed"
    sweeps: int = 1

    @property
    def exchange(self) -> Exchange:
        """As `Coordination.exchange`."""
        return Exchange(self.sweeps)

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """As `Coordination.plans`."""
        known: dict[int, dict[int, Array]] = {s.own.id: {} for s in team}  # to each UAV, its own and those it received
        sequence = self._sequence(team, rng)
        for sweep in range(self.sweeps):
            for situation in sequence:
                sender = situation.own.id
                plans = expected(situation, decision.horizon, known[sender])
                plan = decision.decide(situation, plans, [_row(situation)], rng)[0]
                for s in team:
                    if s.own.id == sender or s.receives(sender, sweep):
                        known[s.own.id][sender] = plan
        return [Plan(known[s.own.id][s.own.id]) for s in team]

    def _sequence(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Situation]:
        if self.order == "random":
            return [team[k] for k in rng.permutation(len(team))]
        if self.order == "worst-first":
            return sorted(team, key=_worst, reverse=True)
        return list(team)


@dataclass(frozen=True)
class Parallel:
    """All UAVs decide at once (PMA), each expecting the others to follow their policy of intent.

    What they have decided they send afterwards.
    """

    exchange = Exchange()

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """As `Coordination.plans`."""
        return [Plan(decision.decide(s, expected(s, decision.horizon), [_row(s)], rng)[0]) for s in team]


@dataclass(frozen=True)
class Decentralised:
    """Dec-POMDP as in [Li22] IV-E: each UAV optimises the joint plan on its own belief and flies its own share.

    No decisions are sent. All search with the same random numbers, agreed beforehand: equal beliefs, equal plans.
    What a UAV takes for the intents of the others are their shares of the joint plan that it made itself.
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
    """One optimisation of the joint plan of all UAVs, on the belief of the first, whoever hears whom."""

    exchange = Exchange(centre=True)

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """As `Coordination.plans`."""
        first = team[0]
        intents = {i: plan for s in team for i, plan in s.intents.items() if i == s.own.id}
        centre = replace(first, neighbours=tuple(s.own for s in team[1:]), intents=intents)
        plans = _joint(centre, decision, int(rng.integers(2**63)))
        rows = {vehicle.id: row for row, vehicle in enumerate(centre.vehicles)}
        return [Plan(plans[rows[s.own.id]]) for s in team]


def expected(situation: Situation, horizon: int, decided: dict[int, Array] | None = None) -> Array:
    """Plans (n, H, 2) m/s of all UAVs: decided ones, else their policies of intent."""
    known = decided or {}
    return np.array(
        [known[v.id] if v.id in known else policy_of_intent(situation, v, horizon) for v in situation.vehicles]
    )


def _joint(situation: Situation, decision: Decision, seed: int) -> Array:
    plans = expected(situation, decision.horizon)
    return decision.decide(situation, plans, range(len(plans)), np.random.default_rng(seed))


def _row(situation: Situation) -> int:
    return situation.vehicles.index(situation.own)


def _worst(situation: Situation) -> float:
    """Largest trace of a position's covariance [m²] among the tracks a UAV can soon be at."""
    near = [
        float(np.trace(t.belief.covariance[:2, :2]))
        for t in situation.tracks
        if length(t.belief.mean[:2] - situation.own.position[:2]) <= BASE_RANGE
    ]
    return max(near, default=0.0)
