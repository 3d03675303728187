"""What a planner is given, what it returns, and the one method it needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from tracking.camera import Camera
from tracking.compiled import Array
from tracking.kalman import NearlyConstantVelocity
from tracking.noise import NoiseModel
from tracking.tracker import Track
from tracking.undetected import Unseen
from tracking.visibility import Forest


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


@dataclass(frozen=True, eq=False)
class Situation:
    """All that one UAV knows when it plans. Nothing in it is ground truth."""

    time: float  # s
    own: Vehicle
    neighbours: tuple[Vehicle, ...]  # by ascending id
    tracks: tuple[Track, ...]  # of its own tracker
    forest: Forest
    area: tuple[float, float]  # m, centred on the origin
    motion: NearlyConstantVelocity  # of the targets, over one planning step
    intents: Mapping[int, Plan] = field(default_factory=dict)  # last plan known of each UAV, its own included
    unseen: Unseen | None = None  # where people may be of whom it has no track; None: it does not ask itself

    @property
    def step(self) -> float:
        """Time between two controls of a plan [s]."""
        return self.motion.dt

    @property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """The whole team as this UAV knows it, by ascending id."""
        return tuple(sorted((self.own, *self.neighbours), key=lambda v: v.id))


class Planner(Protocol):
    """Anything with this method is a planner.

    It keeps no state between calls. A decentralised planner reads, for UAV i, only `team[i]` and plans that
    UAV i receives; it returns one plan per situation, in the same order. `rng` is the only source of chance.
    A UAV that broke down has no situation and is nobody's neighbour, so ids may differ from places in `team`.
    """

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans for all UAVs at this instant."""
        ...
