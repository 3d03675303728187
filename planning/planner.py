"""What a planner is given, what it returns, and the one method it needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from tracking.detection.noise import NoiseModel
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.geometry.camera import Camera
from tracking.geometry.visibility import Forest
from tracking.numerics.compiled import Array
from tracking.plugins.containment import contained
from tracking.tracker import Track
from tracking.undetected import Unseen

LONGEST_PLAN = 1000  # steps; recordings hold them all
_MOST_ROUNDS = 1000


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A UAV as its team knows it."""

    id: int
    position: Array  # (3,) m
    camera: Camera
    noise: NoiseModel
    max_speed: float  # m/s
    # Quaternion of the camera, xyzw, as it stays in level flight; by default it looks down, north at the image's top.
    attitude: Array = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))


@dataclass(frozen=True, eq=False)
class Plan:
    """Velocity commands of one UAV; the first is flown, the rest is its intent."""

    controls: Array  # (H, 2) m/s, east and north
    # What this UAV takes others to fly (H, 2) m/s, by id: all it knows of those in touch whose plan does not reach it.
    others: Mapping[int, Array] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Bytes it takes on the air: sender, time, position and controls, each number eight."""
        return 8 * (5 + np.size(self.controls))


@dataclass(frozen=True)
class Exchange:
    """What UAVs send at each decision: each tells those that hear it its plan, so many times; once if not said.

    With a `centre`, the first UAV plans for all and sends each its plan, over a network that loses nothing.
    """

    rounds: int = 1
    centre: bool = False

    def __post_init__(self) -> None:
        if type(self.rounds) is not int or self.rounds < 0:
            raise ValueError(f"rounds must be a whole number of at least 0, is {self.rounds!r}")
        if self.rounds > _MOST_ROUNDS:
            raise ValueError(f"rounds must be at most {_MOST_ROUNDS}, is {self.rounds}")


def exchange_of(planner: object) -> Exchange:
    """What a planner says that is sent; `Exchange()` where it says nothing of the kind, `ForeignError` if it fails."""
    with contained():
        exchange = getattr(planner, "exchange", None)  # of a stranger's, it may be anything
        # A copy, as what is said stays said, and has been checked.
        return Exchange(exchange.rounds, exchange.centre is True) if isinstance(exchange, Exchange) else Exchange()


@dataclass(frozen=True, eq=False)
class Situation:
    """All that one UAV knows when it plans. Nothing in it is ground truth."""

    time: float  # s
    own: Vehicle
    neighbours: tuple[Vehicle, ...]  # by ascending id
    tracks: tuple[Track, ...]  # of its own tracker
    forest: Forest
    area: tuple[float, float]  # m, centred on the origin
    motion: NearlyConstantVelocity  # of the targets, over one planning step of so many scans of the trackers
    # Last plan known of each UAV, its own included, as made one step ago: of an older one, what was left of it then.
    intents: Mapping[int, Plan] = field(default_factory=dict)
    # For each round of `Exchange`, whose plans of this instant reach this UAV; without any, all neighbours'.
    reception: tuple[tuple[int, ...], ...] = ()
    unseen: Unseen | None = None  # where people may be of whom it has no track; None: it does not ask itself

    @property
    def step(self) -> float:
        """Time between two controls of a plan [s]."""
        return self.motion.dt

    @property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """The whole team as this UAV knows it, by ascending id."""
        return tuple(sorted((self.own, *self.neighbours), key=lambda v: v.id))

    def receives(self, uav: int, sent: int = 0) -> bool:
        """Whether what a UAV sends in a round of this instant reaches this one."""
        return uav in (self.reception[sent] if self.reception else [v.id for v in self.neighbours])


class Planner(Protocol):
    """Anything with this method is a planner.

    One with a method `knowing` too is an oracle: it is given the truth by it, see `planning.oracle`, and marked as
    such wherever its results are shown. What that method returns is flown.

    It keeps no state between calls. A decentralised planner reads, for UAV i, only `team[i]` and plans that
    UAV i receives; it returns one plan per situation, in the same order. `rng` is the only source of chance.
    An attribute `decentralised = True` claims that, and `planning.conformance` tests the claim with all the rest.
    A UAV that broke down has no situation and is nobody's neighbour, so ids may differ from places in `team`.
    A neighbour that has fallen silent is where its last known plan would have brought it, until that plan ends.
    An attribute `exchange` may say what is sent at a decision, if not `Exchange()`; within a call, a decentralised
    planner uses what UAV j has decided for UAV i only where `team[i].receives(j)`.
    """

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans for all UAVs at this instant."""
        ...
