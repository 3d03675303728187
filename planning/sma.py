"""Sequential multi-agent planning (SMA), [Li22] Algorithm 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations
from typing import Literal

import numpy as np

from planning.belief import Outlook, outlook
from planning.intent import policy_of_intent
from planning.nbo import costs
from planning.optimizers import CrossEntropy
from planning.planner import Plan, Situation
from tracking.compiled import Array


@dataclass(frozen=True)
class SMA:
    """SMA-NBO: one UAV after another minimises the team's nominal objective over its own plan alone.

    Those before it have decided; those after it are expected to follow their policy of intent.
    """

    horizon: int = 5
    cost_to_go: Literal["none", "mwtp"] = "mwtp"
    beta: float = 0.5  # weight of the MWTP
    optimizer: CrossEntropy = field(default_factory=CrossEntropy)

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans of the team, in its order, each aware of the plans before it."""
        decided: dict[int, Plan] = {}
        for situation in team:
            decided[situation.own.id] = self._own_plan(situation, decided, rng)
        return [decided[s.own.id] for s in team]

    def _own_plan(self, situation: Situation, decided: dict[int, Plan], rng: np.random.Generator) -> Plan:
        fleet = situation.vehicles
        controls = np.array(
            [decided[v.id].controls if v.id in decided else policy_of_intent(situation, v, self.horizon) for v in fleet]
        )
        view = outlook(situation, self.horizon)
        uav = fleet.index(situation.own)
        beta = self.beta if self.cost_to_go == "mwtp" else 0.0
        objective = partial(costs, view, controls, uav, beta=beta)
        starts = np.concatenate([controls[uav : uav + 1], pursuits(view, uav)])
        return Plan(self.optimizer.minimise(objective, starts, situation.own.max_speed, rng))


NEAREST = 6  # targets that a UAV considers pursuing


def pursuits(view: Outlook, uav: int) -> Array:
    """Plans (S, H, 2) m/s, not speed limited, that hover or chase one near target or the middle of two."""
    position, nominal = view.positions[uav, :2], view.nominal[:, :, :2]
    near = np.argsort(np.linalg.norm(nominal[0] - position, axis=1), kind="stable")[:NEAREST]
    goals = [nominal[:, t] for t in near] + [(nominal[:, a] + nominal[:, b]) / 2 for a, b in combinations(near, 2)]
    starts = [np.zeros((len(nominal), 2))]
    for goal in goals:
        # An equal share of the way each step, and the goal's own motion once above it.
        ahead = view.step * np.arange(1, len(nominal) + 1)[:, None]
        starts.append(np.concatenate([(goal[:1] - position) / view.step, np.diff(goal, axis=0) / view.step]))
        starts.append((goal - position) / ahead)
    return np.array(starts)
