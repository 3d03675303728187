"""Sequential multi-agent planning (SMA), [Li22] Algorithm 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from planning.coordination.decision import Decision, expected_plans, own_row
from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import BASE_RANGE
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length

Order = Literal["fixed", "random", "worst-first"]


@dataclass(frozen=True)
class Sequential:
    """UAVs decide one after another; each knows the plans of those before it, [Li22] Algorithm 3.

    It expects those after it to follow their policy of intent or, in a second sweep, the plan they have made. The same
    holds for UAVs before it whose plans do not reach it. A plan is sent once and not forwarded.
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
                plans = expected_plans(situation, decision.horizon, known[sender])
                plan = decision.decide(situation, plans, [own_row(situation)], rng)[0]
                for s in team:
                    if s.own.id == sender or s.receives(sender, sweep):
                        known[s.own.id][sender] = plan
        return [Plan(known[s.own.id][s.own.id]) for s in team]

    def _sequence(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Situation]:
        if self.order == "random":
            return [team[k] for k in rng.permutation(len(team))]
        if self.order == "worst-first":
            return sorted(team, key=_largest_trace, reverse=True)
        return list(team)


def _largest_trace(situation: Situation) -> float:
    """Largest trace of a position's covariance [m²] among the tracks within the range of the base policy."""
    near = [
        float(np.trace(t.belief.covariance[:2, :2]))
        for t in situation.tracks
        if length(t.belief.mean[:2] - situation.own.position[:2]) <= BASE_RANGE
    ]
    return max(near, default=0.0)
