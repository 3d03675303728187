"""Planners put together from pieces: coordination, belief propagation, cost-to-go, optimiser and occlusion model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal, Protocol

import numpy as np

from planning.coordination import Coordination, Sequential
from planning.objective.nbo import objective
from planning.objective.objective import Objective
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.initial_plans import pursuits, turns
from planning.optimizers.optimizer import Optimizer
from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import followed
from planning.prediction.propagation import Nominal, Propagation, nominal_positions
from planning.prediction.targets_in_reach import Eased, Hints, sights, soonest
from tracking.geometry.visibility import Forest, Occlusion
from tracking.numerics.compiled import Array

Prediction = Literal["scans", "step"]
Actions = Literal["all", "first"]


class Term(Protocol):
    """What a plan costs besides the uncertainty of tracks."""

    def term(self, situation: Situation, controls: Array, uavs: Sequence[int]) -> Objective | None:
        """Cost [m²] of plans of the UAVs in rows `uavs` while others fly `controls` (n, H, 2) m/s; None: nothing."""
        ...


@dataclass(frozen=True)
class Composition:
    """Receding-horizon planning on beliefs; by default SMA-NBO with MWTP, [Li22] III."""

    horizon: int = 5
    coordination: Coordination = field(default_factory=Sequential)
    propagation: Propagation = field(default_factory=Nominal)
    beta: float = 0.5  # weight of the MWTP, the cost-to-go; 0: none
    optimizer: Optimizer = field(default_factory=CrossEntropy)
    occlusion: Occlusion | None = None  # how trees hide; None: as the situation's forest has it
    existence: bool = True  # a target counts by the probability that it exists; False: as one
    terms: tuple[Term, ...] = ()  # of the objective, besides that of the tracks
    prediction: Prediction = "scans"  # of targets: as trackers predict, or with the process noise of one long step
    actions: Actions = "all"  # which are optimised: of the first alone, the base policy follows

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans of the team, in its order."""
        return self.coordination.plans([self._modelled(situation) for situation in team], self, rng)

    @property
    def exchange(self) -> Exchange:
        """What the UAVs send at each decision."""
        return self.coordination.exchange

    def decide(self, situation: Situation, controls: Array, uavs: Sequence[int], rng: np.random.Generator) -> Array:
        """As `planning.coordination.Decision.decide`."""
        view = self.propagation.outlook(situation, self.horizon, rng)
        samples = view.points.shape[1] // len(situation.tracks) if situation.tracks else 1
        if self.existence:
            view = view._replace(weights=np.tile([t.existence for t in situation.tracks], samples).astype(float))
        speeds = np.array([situation.vehicles[i].max_speed for i in uavs])
        starts = self._starts(situation, controls, uavs)
        value: Eased = objective(view, controls, uavs, self.beta, samples)
        extra = [term for term in (t.term(situation, controls, uavs) for t in self.terms) if term is not None]
        if extra:
            value = partial(_sum, value, extra)
        hints = Hints(value, sights(view, uavs, speeds))
        if self.actions == "all":
            return self.optimizer.minimise(value, starts, speeds, rng, hints).plans
        complete = partial(self._completed, situation, uavs)
        value = partial(_of_whole, value, complete)
        first = self.optimizer.minimise(value, starts, speeds, rng, Hints(value, soonest(hints.sights))).plans
        whole: Array = complete(first[None])[0]
        return whole

    def _completed(self, situation: Situation, uavs: Sequence[int], firsts: Array) -> Array:
        """Plans (N, k, H, 2) m/s of the UAVs in rows `uavs`: first controls (N, k, 1, 2), then the base policy."""
        plans = [followed(situation, situation.vehicles[i], firsts[:, j, 0], self.horizon) for j, i in enumerate(uavs)]
        return np.stack(plans, axis=1)

    def _starts(self, situation: Situation, controls: Array, uavs: Sequence[int]) -> Array:
        """What the UAVs are expected to do, and the same with one of them in pursuit or on two legs (S, k, h, 2).

        They are as long as what is optimised.
        """
        length = self.horizon if self.actions == "all" else 1
        intents = controls[list(uavs), :length]
        nominal = nominal_positions(situation.tracks, situation.step, length)
        starts = [intents[None]]
        for j, i in enumerate(uavs):
            vehicle = situation.vehicles[i]
            others = np.concatenate([pursuits(nominal, vehicle, situation.step), turns(vehicle.max_speed, length)])
            joint = np.repeat(intents[None], len(others), axis=0)
            joint[:, j] = others
            starts.append(joint)
        return np.concatenate(starts)

    def _modelled(self, situation: Situation) -> Situation:
        """The situation with the occlusion and the prediction of this planner."""
        if self.occlusion is not None and self.occlusion != situation.forest.occlusion:
            situation = replace(situation, forest=Forest(situation.forest.trees, self.occlusion))
        if self.prediction == "step":
            situation = replace(situation, motion=replace(situation.motion, scans=1))
        return situation


def _of_whole(value: Eased, complete: Callable[[Array], Array], firsts: Array, ease: Array | None = None) -> Array:
    """What an objective of whole plans comes to, of their beginnings."""
    return value(complete(firsts), ease)


def _sum(first: Eased, terms: Sequence[Objective], candidates: Array, ease: Array | None = None) -> Array:
    """What an objective and other terms come to, of which none can be eased."""
    return np.asarray(first(candidates, ease) + sum(term(candidates) for term in terms))
