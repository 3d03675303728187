"""Planners composed of pieces that are given by name, as in `--planner 'sma-nbo(horizon=3)'`, or as objects."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Annotated, Literal

import numpy as np

from planning.coordination.decision import Coordination
from planning.coordination.schemes import Centralised, Decentralised, Order, Parallel, Sequential, SequentialPartitions
from planning.objective.connectivity import Connectivity
from planning.objective.cost_to_go import LATEST, cost_to_go
from planning.objective.nbo import Measure, make_objective
from planning.objective.terms import Search, Separation, Term
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.grid_search import GridSearch
from planning.optimizers.optimizer import Optimizer, make_pursuits, make_turns
from planning.optimizers.particle_swarm import ParticleSwarm
from planning.options import Range, check_options
from planning.planner import Exchange, Plan, Situation
from planning.prediction.intent import base_policy_plans
from planning.prediction.propagation import MonteCarlo, Nominal, Propagation, nominal_positions
from planning.prediction.response import mean_velocities, response
from planning.prediction.surroundings import find_surroundings
from planning.prediction.targets_in_reach import find_targets_in_reach
from tracking.management.escapes import Escapes
from tracking.numerics.arrays import Array
from tracking.track import Track

# Options that have an effect only if another option has this value.
_NEEDS = {
    "order": ("coordination", "sequential"),
    "sweeps": ("coordination", "sequential"),
    "rounds": ("coordination", "partitions"),
    "samples": ("propagation", "monte-carlo"),
    "visibility": ("propagation", "nominal"),
}
_OPTIMIZERS: dict[str, CrossEntropy | ParticleSwarm | GridSearch] = {
    "cross-entropy": CrossEntropy(),
    "particle-swarm": ParticleSwarm(),
    "grid": GridSearch(),
}


@dataclass(frozen=True)
class Composed:
    """Receding-horizon planning on beliefs, by default SMA-NBO with MWTP, [Li22] III.

    Coordination, propagation and optimiser are given by name or, from Python, as objects of your own. ValueError names
    a wrong option and its allowed values.
    """

    # The upper bounds are wider than any useful setting, but small enough that memory suffices.

    horizon: Annotated[int, Range(1, 100)] = 5  # steps of a plan
    # how UAVs decide: `sequential`, `parallel`, `decentralised`, `centralised`, or in rounds (`partitions`), where each
    # UAV considers only the plans of UAVs that have decided
    coordination: Literal["sequential", "parallel", "decentralised", "centralised", "partitions"] | Coordination = (
        "sequential"
    )
    # order of the sequence: `fixed` (by id), `random`, or `worst-first` (by the most uncertain track within 40 m)
    order: Order = "fixed"
    # number of passes through the sequence; from the second on, each UAV knows the plans that the others have made
    sweeps: Annotated[int, Range(1, 100)] = 1
    # rounds of `partitions`: each UAV draws one, and all of a round decide at once; 0: one UAV per round, by id
    rounds: Annotated[int, Range(0, 100)] = 0
    # beliefs follow each target's most probable trajectory (`nominal`) or samples (`monte-carlo`)
    propagation: Literal["nominal", "monte-carlo"] | Propagation = "nominal"
    samples: Annotated[int, Range(1, 10_000)] = 50  # number of samples of Monte Carlo propagation
    # targets are seen or hidden along their nominal trajectory (`nominal`), or the cost is the mean over five equally
    # probable trajectories through their predicted beliefs (`expected`)
    visibility: Literal["nominal", "expected"] = "nominal"
    beta: Annotated[float, Range(0, 1e6)] = 0.5  # weight of the MWTP, the paper's cost-to-go; 0: none (truncated)
    # `cross-entropy`, `particle-swarm`, or, for small cases, `grid`, which tries all plans made of nine controls
    optimizer: Literal["cross-entropy", "particle-swarm", "grid"] | Optimizer = "cross-entropy"
    # evaluations of the objective for each UAV's plan; 0: 12288, 51 moves of the swarm, or all plans of the grid
    evaluations: Annotated[int, Range(0, 10_000_000)] = 0
    # time [s] for each UAV's plan: cross-entropy searches for this time, a swarm or grid stops after it; 0: no limit
    seconds: Annotated[float, Range(0, 3600)] = 0.0
    # model of occlusion by trees: `line_of_sight` or the paper's `disc`; empty: the scenario's
    occlusion: Literal["", "line_of_sight", "disc"] = ""
    # True: a track is weighted by its probability of existence, if the tracker gives one; False: by one
    existence: bool = True
    # weight [m²] of search: a person without a track counts as one whose position covariance has this trace; 0: none
    search: Annotated[float, Range(0, 1e6)] = 0.0
    # least distance [m] from the expected paths of other UAVs; 0: no limit
    separation: Annotated[float, Range(0, 1e4)] = 0.0
    # weight [m²] of connectivity: cost of each step and each UAV that no chain of UAVs within radio range joins to the
    # deciding one; 0: none
    connectivity: Annotated[float, Range(0, 1e6)] = 0.0
    # growth of a belief over a planning step: `scans`: as in trackers, which draw the acceleration anew at each scan;
    # `step`: one acceleration for the whole step, so hidden people are expected farther away
    prediction: Literal["scans", "step"] = "scans"
    # controls that are optimised: `all`, or the `first`, after which the UAV flies at full speed to the track of
    # largest covariance within 40 m
    actions: Literal["all", "first"] = "all"
    # cost of tracks: the sum of their covariances' `trace`, or minus the mutual `information` [nats] between paths and
    # measurements, which needs `beta=0` and measures `search` in nats
    uncertainty: Literal["trace", "information"] = "trace"
    # cut-off c [m] of GOSPA: the expected squared error up to c replaces the trace, so that a lost person costs at most
    # c² per step; `search` is not cut off; 0: the trace
    cutoff: Annotated[float, Range(0, 1e6)] = 0.0
    # weight of a learned cost-to-go: errors of tracks in the 15 s after the plan; 0: none
    cost_to_go: Annotated[float, Range(0, 1e6)] = 0.0
    # time scale [s] of turns of people out of sight, such as 20; they are searched for wherever they can have walked
    # unseen; 0: they go on as tracks predict
    escape: Annotated[float, Range(0, 1e6)] = 0.0

    def __post_init__(self) -> None:
        check_options(self)
        for name, (piece, word) in _NEEDS.items():
            value, usual, chosen = getattr(self, name), getattr(Composed, name), getattr(self, piece)
            if value != usual and chosen != word:
                raise ValueError(
                    f"{name}={value} has no effect with {piece} {chosen!r}; set {name}={usual} or {piece}={word}"
                )
        for name in ("beta", "cutoff", "cost_to_go") if self.uncertainty == "information" else ():
            if value := getattr(self, name):
                raise ValueError(f"{name}={value} has no effect with uncertainty 'information'; set {name}=0")
        if self.escape and not self.existence:
            raise ValueError(f"escape={self.escape} needs probabilities of existence; set escape=0 or existence=True")
        if self.cost_to_go and not self.cutoff:
            raise ValueError(f"cost_to_go={self.cost_to_go} needs a cut-off; set cost_to_go=0 or cutoff=10")

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans of the team, in its order."""
        if self.escape:
            team = [replace(s, tracks=self._split_lost_tracks(s)) for s in team]
        return self.scheme.make_plans([self._apply_models(situation) for situation in team], self, rng)

    def _split_lost_tracks(self, s: Situation) -> tuple[Track, ...]:
        """The tracks of a situation, with people who may have turned out of sight as further ones."""
        escapes = self._escapes.setdefault(s.own.id, Escapes(self.escape))
        parts = escapes.split(s.time, s.tracks, s.looks, s.forest, s.area)
        return tuple(part.renumber(n) for n, part in enumerate(parts))

    @property
    def stateful(self) -> bool:
        """True if plans depend on earlier frames."""
        return self.escape > 0.0

    def reset(self, seed: int) -> None:
        """Forget earlier frames."""
        self._escapes.clear()

    @cached_property
    def _escapes(self) -> dict[int, Escapes]:
        """What each UAV knows about people out of sight, by id."""
        return {}

    @property
    def exchange(self) -> Exchange:
        """Plans that the UAVs send at each decision."""
        return self.scheme.exchange

    @property
    def decentralised(self) -> bool:
        """True if UAVs need only plans of each other."""
        return self.scheme.decentralised

    @cached_property
    def scheme(self) -> Coordination:
        """Coordination as an object."""
        schemes: dict[object, Coordination] = {
            "sequential": Sequential(self.order, self.sweeps),
            "parallel": Parallel(),
            "decentralised": Decentralised(),
            "centralised": Centralised(),
            "partitions": SequentialPartitions(self.rounds),
        }
        return schemes[self.coordination] if isinstance(self.coordination, str) else self.coordination

    @cached_property
    def propagator(self) -> Propagation:
        """Propagation as an object."""
        if isinstance(self.propagation, str):
            nominal = self.propagation == "nominal"
            return Nominal(self.visibility == "expected") if nominal else MonteCarlo(self.samples)
        return self.propagation

    @cached_property
    def minimiser(self) -> Optimizer:
        """Optimiser as an object."""
        if isinstance(self.optimizer, str):
            usual = _OPTIMIZERS[self.optimizer]
            return replace(usual, evaluations=self.evaluations or usual.evaluations, seconds=self.seconds)
        return self.optimizer

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Terms of the objective besides the uncertainty of tracks; a subclass may have others."""
        given = ((Search, self.search), (Separation, self.separation), (Connectivity, self.connectivity))
        return tuple(make(value) for make, value in given if value)

    def decide(self, situation: Situation, controls: Array, uavs: Sequence[int], rng: np.random.Generator) -> Array:
        """As `planning.coordination.decision.Decider.decide`."""
        # The MWTP counts what is out of reach, and samples depend on the number of targets.
        local = self.beta == 0.0 and isinstance(self.propagator, Nominal)
        steps = self.horizon + (math.ceil(LATEST / situation.step) if self.cost_to_go else 0)
        scene, rows = find_surroundings(situation, uavs, steps) if local else (situation, np.arange(len(controls)))
        belief = self.propagator.predict(scene, self.horizon, rng)
        samples = belief.points.shape[1] // len(scene.tracks) if scene.tracks else 1
        if self.existence:
            belief = belief._replace(weights=np.tile([t.existence for t in scene.tracks], samples).astype(float))
        starts = self._make_initial_plans(situation, controls, uavs)
        vehicles, step = situation.vehicles, situation.step
        ahead = cost_to_go(scene.vehicles, float(self.cost_to_go))
        measure = Measure(self.uncertainty == "information", float(self.cutoff) or math.inf, ahead)
        own, fleet = response([vehicles[i] for i in uavs], step), response(vehicles, step)
        expected = mean_velocities(fleet, np.ascontiguousarray(controls[None], dtype=float))[0]
        deciding = np.searchsorted(rows, uavs).tolist()
        of_tracks = make_objective(belief, expected[rows], deciding, self.beta, samples, measure)
        others = [term.objective(situation, expected, uavs) for term in self.terms]
        of_others = [one for one in others if one is not None]

        def value(candidates: Array, ease: Array | None = None) -> Array:
            """Sum of all terms; `ease` relaxes only the term of tracks."""
            plans = self._complete(situation, uavs, candidates)
            velocities = mean_velocities(own, np.ascontiguousarray(plans, dtype=float))
            found = of_tracks(velocities, ease)
            return found + reduce(np.add, (one(velocities) for one in of_others)) if of_others else found

        speeds = np.array([vehicles[i].max_speed for i in uavs])
        in_reach = find_targets_in_reach(belief, deciding, speeds, own)
        soon = in_reach.steps < starts.shape[2]
        in_reach = in_reach._replace(rows=in_reach.rows[soon], steps=in_reach.steps[soon], places=in_reach.places[soon])
        found = self.minimiser.minimise(value, starts, speeds, rng, in_reach)
        return np.asarray(self._complete(situation, uavs, found[None])[0])

    def _complete(self, situation: Situation, uavs: Sequence[int], given: Array) -> Array:
        """Plans (N, k, H, 2) m/s of the UAVs in rows `uavs`: controls (N, k, h, 2), then the base policy."""
        if self.actions == "all":
            return given
        plans = [
            base_policy_plans(situation, situation.vehicles[i], given[:, j], self.horizon) for j, i in enumerate(uavs)
        ]
        return np.stack(plans, axis=1)

    def _make_initial_plans(self, situation: Situation, controls: Array, uavs: Sequence[int]) -> Array:
        """Initial plans (S, k, h, 2) m/s over the h steps that are optimised.

        They are the intents, and the intents with one UAV that pursues a target or flies two straight legs instead.
        """
        length = self.horizon if self.actions == "all" else 1
        intents = controls[list(uavs), :length]
        nominal = nominal_positions(situation, length)
        starts = [intents[None]]
        for j, i in enumerate(uavs):
            vehicle = situation.vehicles[i]
            others = np.concatenate(
                [make_pursuits(nominal, vehicle, situation.step), make_turns(vehicle.max_speed, length)]
            )
            joint = np.repeat(intents[None], len(others), axis=0)
            joint[:, j] = others
            starts.append(joint)
        return np.concatenate(starts)

    def _apply_models(self, situation: Situation) -> Situation:
        """The situation with the occlusion model and the motion model of this planner."""
        if self.occlusion and self.occlusion != situation.forest.occlusion:
            situation = replace(situation, forest=replace(situation.forest, occlusion=self.occlusion))
        if self.prediction == "step":
            situation = replace(situation, motion=replace(situation.motion, scans=1))
        return situation
