"""Planners composed of pieces: coordination, belief propagation, cost-to-go, optimiser and occlusion model."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Literal, Protocol

import numpy as np

from planning.coordination.decision import Decision
from planning.coordination.schemes import Sequential
from planning.objective.cost_to_go import cost_to_go
from planning.objective.nbo import Measure, objective
from planning.objective.objective import Objective
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.optimizer import Optimizer, pursuits, turns
from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import base_policy_plans
from planning.prediction.propagation import Nominal, Propagation, nominal_positions
from planning.prediction.response import mean_velocities, response
from planning.prediction.targets_in_reach import targets_in_reach
from tracking.geometry.visibility import Forest, Occlusion
from tracking.numerics.arrays import Array

Prediction = Literal["scans", "step"]
Actions = Literal["all", "first"]
Uncertainty = Literal["trace", "information"]


class Coordination(Protocol):
    """Makes a team's plans out of decisions."""

    @property
    def exchange(self) -> Exchange:
        """Plans that the UAVs send at each decision."""

    def plans(self, team: Sequence[Situation], decision: Decision, rng: np.random.Generator) -> list[Plan]:
        """The plan of each UAV, in the team's order."""


class Term(Protocol):
    """A term of the objective besides the uncertainty of tracks."""

    def term(self, situation: Situation, velocities: Array, uavs: Sequence[int]) -> Objective | None:
        """Cost [m²] as a function of the mean velocities of UAVs `uavs`; the others fly `velocities`. None if zero.

        velocities (n, H, 2) m/s: a row for each UAV of `situation.vehicles`.
        """


@dataclass(frozen=True)
class Composition:
    """Receding-horizon planning on beliefs; by default SMA-NBO with MWTP, [Li22] III."""

    horizon: int = 5
    coordination: Coordination = field(default_factory=Sequential)
    propagation: Propagation = field(default_factory=Nominal)
    beta: float = 0.5  # weight of the MWTP, the paper's cost-to-go; 0 leaves it out
    optimizer: Optimizer = field(default_factory=CrossEntropy)
    occlusion: Occlusion | None = None  # model of occlusion by trees; None: the model of the situation's forest
    existence: bool = True  # True: weight targets by their existence probability; False: weight all alike
    terms: tuple[Term, ...] = ()  # further terms of the objective
    prediction: Prediction = "scans"  # process noise of targets: of each scan, as in trackers, or of one long step
    actions: Actions = "all"  # actions to optimise: all, or the first, after which the UAV follows the base policy
    uncertainty: Uncertainty = "trace"  # cost of tracks: their summed traces, or minus the mutual information [nats]
    cost_to_go: float = 0.0  # weight of the learned cost-to-go, which needs a finite cut-off; 0 leaves it out
    cutoff: float = np.inf  # distance [m], above 0, at which errors are cut off; infinite: the trace itself

    def __post_init__(self) -> None:
        if not self.cutoff > 0.0:
            raise ValueError(f"cutoff must be above 0 m, is {self.cutoff}; infinite: the trace")
        if self.cost_to_go > 0.0 and self.cutoff == np.inf:
            raise ValueError(f"cost_to_go={self.cost_to_go} needs a finite cutoff, is {self.cutoff}")

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans of the team, in its order."""
        return self.coordination.plans([self._modelled(situation) for situation in team], self, rng)

    @property
    def exchange(self) -> Exchange:
        """Plans that the UAVs send at each decision."""
        return self.coordination.exchange

    def decide(self, situation: Situation, controls: Array, uavs: Sequence[int], rng: np.random.Generator) -> Array:
        """As `coordination.decision.Decision.decide`."""
        belief = self.propagation.predict(situation, self.horizon, rng)
        samples = belief.points.shape[1] // len(situation.tracks) if situation.tracks else 1
        if self.existence:
            belief = belief._replace(weights=np.tile([t.existence for t in situation.tracks], samples).astype(float))
        starts = self._starts(situation, controls, uavs)
        vehicles, step = situation.vehicles, situation.step
        measure = Measure(self.uncertainty == "information", self.cutoff, cost_to_go(vehicles, self.cost_to_go))
        own, fleet = response([vehicles[i] for i in uavs], step), response(vehicles, step)
        expected = mean_velocities(fleet, np.ascontiguousarray(controls[None], dtype=float))[0]
        of_tracks = objective(belief, expected, uavs, self.beta, samples, measure)
        extra = [term for term in (t.term(situation, expected, uavs) for t in self.terms) if term is not None]

        def value(candidates: Array, ease: Array | None = None) -> Array:
            """Sum of all terms; `ease` relaxes only the term of tracks."""
            plans = self._completed(situation, uavs, candidates)
            velocities = mean_velocities(own, np.ascontiguousarray(plans, dtype=float))
            found = of_tracks(velocities, ease)
            return found + reduce(np.add, (term(velocities) for term in extra)) if extra else found

        speeds = np.array([vehicles[i].max_speed for i in uavs])
        in_reach = targets_in_reach(belief, uavs, speeds, own)
        soon = in_reach.which[:, 1] < starts.shape[2]
        in_reach = in_reach._replace(which=in_reach.which[soon], places=in_reach.places[soon])
        found = self.optimizer.minimise(value, starts, speeds, rng, in_reach)
        return np.asarray(self._completed(situation, uavs, found[None])[0])

    def _completed(self, situation: Situation, uavs: Sequence[int], firsts: Array) -> Array:
        """Plans (N, k, H, 2) m/s of the UAVs in rows `uavs`: controls (N, k, h, 2), then the base policy."""
        if self.actions == "all":
            return firsts
        plans = [
            base_policy_plans(situation, situation.vehicles[i], firsts[:, j], self.horizon) for j, i in enumerate(uavs)
        ]
        return np.stack(plans, axis=1)

    def _starts(self, situation: Situation, controls: Array, uavs: Sequence[int]) -> Array:
        """Initial plans (S, k, h, 2) m/s over the h steps that are optimised.

        They are the intents, and the intents with one UAV that pursues a target or flies two straight legs instead.
        """
        length = self.horizon if self.actions == "all" else 1
        intents = controls[list(uavs), :length]
        nominal = nominal_positions(situation, length)
        starts = [intents[None]]
        for j, i in enumerate(uavs):
            vehicle = situation.vehicles[i]
            others = np.concatenate([pursuits(nominal, vehicle, situation.step), turns(vehicle.max_speed, length)])
            joint = np.repeat(intents[None], len(others), axis=0)
            joint[:, j] = others
            starts.append(joint)
        return np.concatenate(starts)

    def _modelled(self, situation: Situation) -> Situation:
        """The situation with the occlusion model and the motion model of this planner."""
        if self.occlusion is not None and self.occlusion != situation.forest.occlusion:
            situation = replace(situation, forest=Forest(situation.forest.trees, self.occlusion))
        if self.prediction == "step":
            situation = replace(situation, motion=replace(situation.motion, scans=1))
        return situation
