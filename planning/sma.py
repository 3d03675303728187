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
from planning.optimizers import CrossEntropy, limited
from planning.planner import Plan, Situation, Vehicle
from planning.view import MARKS, shown_at
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
        speed = situation.own.max_speed
        starts = np.concatenate([controls[uav : uav + 1], pursuits(view, uav, situation.own)])
        return Plan(self.optimizer.minimise(objective, starts, speed, rng))


NEAREST = 6  # targets that a UAV considers pursuing


def pursuits(view: Outlook, uav: int, vehicle: Vehicle) -> Array:
    """Plans (S, H, 2) m/s that hover, or chase one near target or the middle of two at full speed."""
    position, nominal, spots = view.positions[uav, :2], view.nominal[:, :, :2], shown_at(vehicle, MARKS)
    near = np.argsort(np.linalg.norm(nominal[0] - position - spots[0], axis=1), kind="stable")[:NEAREST]
    goals = [nominal[:, t] - spot for t in near for spot in spots]
    goals += [(nominal[:, a] + nominal[:, b]) / 2 - spots[0] for a, b in combinations(near, 2)]
    goals.append(np.tile(position, (len(nominal), 1)))
    reached = np.tile(position, (len(goals), 1))
    plans = np.empty((len(goals), len(nominal), 2))
    for step, goal in enumerate(np.stack(goals, axis=1)):
        plans[:, step] = limited((goal - reached) / view.step, vehicle.max_speed)
        reached = reached + view.step * plans[:, step]
    return plans
