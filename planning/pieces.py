"""Planners composed of pieces that are given by name, as in `--planner 'sma-nbo(horizon=3)'`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args, get_type_hints

import numpy as np

from planning.composition import Actions, Composition, Coordination, Prediction, Uncertainty
from planning.coordination.partitions import Partitions
from planning.coordination.schemes import Centralised, Decentralised, Order, Parallel, Sequential
from planning.objective.terms import Search, Separation
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.grid_search import GridSearch
from planning.optimizers.particle_swarm import ParticleSwarm
from planning.planner import Exchange, Plan, Situation
from planning.prediction.propagation import MonteCarlo, Nominal
from tracking.errors import nearest

# Least and largest values: wider than any useful setting, but too small to use up all memory.
_RANGES = {"horizon": (1, 100), "sweeps": (1, 100), "samples": (1, 10_000), "beta": (0, 1e6)}
_RANGES |= {"evaluations": (0, 10_000_000), "seconds": (0, 3600), "search": (0, 1e6), "separation": (0, 1e4)}
_RANGES |= {"rounds": (0, 100), "cutoff": (0, 1e6), "cost_to_go": (0, 1e6)}
_NEEDS = {"order": ("coordination", "sequential"), "samples": ("propagation", "monte-carlo")}
_NEEDS |= {"rounds": ("coordination", "partitions"), "sweeps": ("coordination", "sequential")}
_NEEDS |= {"visibility": ("propagation", "nominal")}


@dataclass(frozen=True)
class Composed:
    """A `Composition` of pieces that are given by name; ValueError names a wrong option and its allowed values."""

    horizon: int = 5  # steps of a plan
    # how UAVs decide: `sequential`, `parallel`, `decentralised`, `centralised`, or in rounds (`partitions`), where each
    # UAV considers only the plans of UAVs that have decided
    coordination: Literal["sequential", "parallel", "decentralised", "centralised", "partitions"] = "sequential"
    # order of the sequence: `fixed` (by id), `random`, or `worst-first` (by the most uncertain track within 40 m)
    order: Order = "fixed"
    # number of passes through the sequence; from the second on, each UAV knows the plans that the others have made
    sweeps: int = 1
    # rounds of `partitions`: each UAV draws one, and all of a round decide at once; 0: one UAV per round, by id
    rounds: int = 0
    # beliefs follow each target's most probable trajectory (`nominal`) or samples (`monte-carlo`)
    propagation: Literal["nominal", "monte-carlo"] = "nominal"
    samples: int = 50  # number of samples of Monte Carlo propagation
    # targets are seen or hidden along their nominal trajectory (`nominal`), or the cost is the mean over five equally
    # probable trajectories through their predicted beliefs (`expected`)
    visibility: Literal["nominal", "expected"] = "nominal"
    beta: float = 0.5  # weight of the MWTP, the paper's cost-to-go; 0: none (truncated)
    # `cross-entropy`, `particle-swarm`, or, for small cases, `grid`, which tries all plans made of nine controls
    optimizer: Literal["cross-entropy", "particle-swarm", "grid"] = "cross-entropy"
    # evaluations of the objective for each UAV's plan; 0: 12288, 51 moves of the swarm, or all plans of the grid
    evaluations: int = 0
    # time [s] for each UAV's plan: cross-entropy searches for this time, a swarm or grid stops after it; 0: no limit
    seconds: float = 0.0
    # model of occlusion by trees: `line_of_sight` or the paper's `disc`; empty: the scenario's
    occlusion: Literal["", "line_of_sight", "disc"] = ""
    # True: a track is weighted by its probability of existence, if the tracker gives one; False: by one
    existence: bool = True
    # weight [m²] of search: a person without a track counts as one whose position covariance has this trace; 0: none
    search: float = 0.0
    separation: float = 0.0  # least distance [m] from the expected paths of other UAVs; 0: no limit
    # growth of a belief over a planning step: `scans`: as in trackers, which draw the acceleration anew at each scan;
    # `step`: one acceleration for the whole step, so hidden people are expected farther away
    prediction: Prediction = "scans"
    # controls that are optimised: `all`, or the `first`, after which the UAV flies at full speed to the track of
    # largest covariance within 40 m, as the MCR of the paper's public code does
    actions: Actions = "all"
    # cost of tracks: the sum of their covariances' `trace`, or minus the mutual `information` [nats] between paths and
    # measurements, which needs `beta=0` and measures `search` in nats
    uncertainty: Uncertainty = "trace"
    # cut-off c [m] of GOSPA: the expected squared error up to c replaces the trace, so that a lost person costs at most
    # c² per step; `search` is not cut off; 0: the trace
    cutoff: float = 0.0
    # weight of a learned cost-to-go: errors of tracks in the 15 s after the plan; 0: none
    cost_to_go: float = 0.0

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(Composed).items():
            choices = get_args(kind)
            if choices and getattr(self, name) not in choices:
                allowed = ", ".join(repr(choice) for choice in choices)
                near = nearest(str(getattr(self, name)), choices)
                raise ValueError(f"{name} {getattr(self, name)!r} is unknown; allowed are {allowed}{near}")
        if not isinstance(self.existence, bool):
            raise ValueError(f"existence must be True or False, is {self.existence!r}")
        for name, (least, most) in _RANGES.items():
            value, whole = getattr(self, name), isinstance(getattr(Composed, name), int)
            if type(value) not in ((int,) if whole else (int, float)) or not least <= value <= most:
                kind = "a whole number" if whole else "a finite number"
                raise ValueError(f"{name} must be {kind} from {least} to {most:g}, is {value!r}")
        self._check_effects()

    def _check_effects(self) -> None:
        """Check that each given option has an effect."""
        for name, (piece, word) in _NEEDS.items():
            if getattr(self, name) != getattr(Composed, name) and getattr(self, piece) != word:
                raise ValueError(
                    f"{name}={getattr(self, name)} has no effect with {piece} {getattr(self, piece)!r}; "
                    f"set {name}={getattr(Composed, name)} or {piece}={word}"
                )
        for name in ("beta", "cutoff", "cost_to_go") if self.uncertainty == "information" else ():
            if value := getattr(self, name):
                raise ValueError(f"{name}={value} has no effect with uncertainty 'information'; set {name}=0")
        if self.cost_to_go and not self.cutoff:
            raise ValueError(f"cost_to_go={self.cost_to_go} needs a cut-off; set cost_to_go=0 or cutoff=10")

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans of the team, in its order."""
        return self.composition.plan(team, rng)

    @property
    def exchange(self) -> Exchange:
        """Plans that the UAVs send at each decision."""
        return self.composition.exchange

    @property
    def decentralised(self) -> bool:
        """True if UAVs need only plans of each other; the order "worst-first" compares beliefs."""
        return self.coordination != "centralised" and (self.coordination != "sequential" or self.order != "worst-first")

    @cached_property
    def composition(self) -> Composition:
        """The pieces put together."""
        coordinations: dict[str, Coordination] = {
            "sequential": Sequential(self.order, self.sweeps),
            "parallel": Parallel(),
            "decentralised": Decentralised(),
            "centralised": Centralised(),
            "partitions": Partitions(self.rounds),
        }
        optimizers: dict[str, CrossEntropy | ParticleSwarm | GridSearch] = {
            "cross-entropy": CrossEntropy(),
            "particle-swarm": ParticleSwarm(),
            "grid": GridSearch(),
        }
        usual = optimizers[self.optimizer]
        nominal, monte_carlo = Nominal(self.visibility == "expected"), MonteCarlo(self.samples)
        return Composition(
            horizon=self.horizon,
            coordination=coordinations[self.coordination],
            propagation=nominal if self.propagation == "nominal" else monte_carlo,
            beta=self.beta,
            optimizer=replace(usual, evaluations=self.evaluations or usual.evaluations, seconds=self.seconds),
            occlusion=self.occlusion or None,
            existence=self.existence,
            terms=(
                *([Search(self.search)] if self.search else []),
                *([Separation(self.separation)] if self.separation else []),
            ),
            prediction=self.prediction,
            actions=self.actions,
            uncertainty=self.uncertainty,
            cutoff=float(self.cutoff) or math.inf,
            cost_to_go=float(self.cost_to_go),
        )
