"""Parallel multi-agent planning (PMA)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planning.coordination.decision import Decision, expected_plans, own_row
from planning.planner import Exchange, Plan, Situation


@dataclass(frozen=True)
class Parallel:
    """All UAVs decide at once and then send their plans; each expects the others to follow their policy of intent."""

    exchange = Exchange()

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """As `Coordination.plans`."""
        return [Plan(decision.decide(s, expected_plans(s, decision.horizon), [own_row(s)], rng)[0]) for s in team]
