"""Situations made by chance, without a mission: what planners are tried on."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from planning.planner import Plan, Situation, Vehicle
from tracking.detection.noise import NoiseModel
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.geometry.camera import Camera
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.compiled import Array
from tracking.tracker import Track
from tracking.undetected import Unseen

KNOWLEDGE = (
    "tracks",
    "received intents",
    "own measured position",
    "neighbours' positions",
    "people not found",
)  # what `otherwise` can change


def specimen_team(
    seed: int, *, uavs: int = 3, targets: int = 4, trees: int = 45, spread: float = 25.0
) -> list[Situation]:
    """Situations of a team whose members hold the same beliefs, in a random forest.

    UAVs and targets are within `spread` m of the middle of the area.
    """
    rng = np.random.default_rng(seed)
    forest = Forest(tuple(Tree(*rng.uniform([-75, -50], [75, 50])) for _ in range(trees)))
    vehicles = [
        Vehicle(
            i,
            np.array([*rng.uniform(-spread, spread, 2), (17.3, 21.7, 19.1)[i % 3]]),
            Camera(math.radians(60), 128),
            NoiseModel.range_bearing((0.1, 0.15, 0.12)[i % 3]),
            5.0,
        )
        for i in range(uavs)
    ]
    tracks = tuple(
        Track(t, Gaussian(np.r_[rng.uniform(-spread, spread, 2), rng.normal(0, 1.2, 2)], _random_covariance(rng)))
        for t in range(targets)
    )
    motion = NearlyConstantVelocity(1.0, 0.5, scans=5)
    return [
        Situation(0.0, v, tuple(w for w in vehicles if w is not v), tracks, forest, (150.0, 100.0), motion)
        for v in vehicles
    ]


def _random_covariance(rng: np.random.Generator) -> Array:
    root = rng.normal(size=(4, 4)) * np.array([0.8, 0.8, 0.4, 0.4])
    return np.asarray(root @ root.T + 0.05 * np.eye(4))


def ordinary_team(seed: int = 0, targets: int = 4) -> list[Situation]:
    """Three UAVs in flight: each has beliefs and a top speed of its own, and knows the last plans of two of them.

    Each takes people whom it has not found yet to be in some places of its own.
    """
    rng, places = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
    team = specimen_team(seed, targets=targets)
    fleet = {s.own.id: replace(s.own, max_speed=5.0 - s.own.id) for s in team}
    intents = {i: Plan(rng.uniform(-2.0, 2.0, (5, 2))) for i in (0, 1)}
    return [
        replace(
            s,
            time=12.0,
            own=fleet[s.own.id],
            neighbours=tuple(fleet[v.id] for v in s.neighbours),
            tracks=tuple(_moved(track, rng.normal(0.0, 0.5, 4), 1.0) for track in s.tracks),
            intents=dict(intents),
            unseen=_sprinkled(places),
        )
        for s in team
    ]


def _sprinkled(rng: np.random.Generator) -> Unseen:
    people = np.where(rng.random((20, 30)) < 0.1, rng.random((20, 30)), 0.0)
    return Unseen(people, (-75.0, -50.0), (5.0, 5.0))


def among(team: Sequence[Situation], ids: Collection[int]) -> list[Situation]:
    """What is left of a team when only UAVs `ids` work."""
    return [_hearing(s, ids) for s in team if s.own.id in ids]


def apart(team: Sequence[Situation], uav: int) -> list[Situation]:
    """The team if one UAV neither hears the others nor is heard."""
    everyone = {s.own.id for s in team}
    return [_hearing(s, {uav} if s.own.id == uav else everyone - {uav}) for s in team]


def held(team: Sequence[Situation], uav: int) -> list[Situation]:
    """The team if one UAV can hardly move, so that its plan says nothing of what it knows.

    Its top speed of 1e-20 m/s is not zero, by which planners may divide, but no position shows it.
    """

    def slow(vehicle: Vehicle) -> Vehicle:
        return replace(vehicle, max_speed=1e-20) if vehicle.id == uav else vehicle

    return [
        replace(
            s,
            own=slow(s.own),
            neighbours=tuple(slow(v) for v in s.neighbours),
            intents={i: plan for i, plan in s.intents.items() if i != uav},
        )
        for s in team
    ]


def lost(team: Sequence[Situation], uav: int, rounds: int) -> list[Situation]:
    """The team if of one UAV's plan nobody receives anything in any round; positions and last plans are known."""
    heard = {s.own.id: tuple(v.id for v in s.neighbours if v.id != uav) for s in team}
    return [replace(s, reception=(heard[s.own.id],) * max(rounds, 1)) for s in team]


def otherwise(team: Sequence[Situation], uavs: Collection[int], kinds: Collection[str]) -> list[Situation]:
    """The team if UAVs `uavs` hold something else, of some kinds of `KNOWLEDGE`; as many tracks as before."""
    return [reduce(_other, kinds, s) if s.own.id in uavs else s for s in team]


def _other(s: Situation, kind: str) -> Situation:
    aside = np.array([2.0, -1.0, 0.0])
    if kind == "tracks":
        return replace(s, tracks=tuple(_moved(t, np.array([3.0, -2.0, 0.5, 0.3]), 4.0) for t in s.tracks))
    if kind == "received intents":
        return replace(s, intents={i: Plan(-plan.controls) for i, plan in s.intents.items()})
    if kind == "people not found":
        return s if s.unseen is None else replace(s, unseen=replace(s.unseen, people=s.unseen.people[::-1].copy()))
    if kind == "own measured position":
        return replace(s, own=replace(s.own, position=s.own.position + aside))
    return replace(s, neighbours=tuple(replace(v, position=v.position - aside) for v in s.neighbours))


def _hearing(s: Situation, ids: Collection[int]) -> Situation:
    return replace(
        s,
        neighbours=tuple(v for v in s.neighbours if v.id in ids),
        intents={i: plan for i, plan in s.intents.items() if i in ids},
    )


def _moved(track: Track, by: Array, times: float) -> Track:
    return replace(track, belief=Gaussian(track.belief.mean + by, times * track.belief.covariance))
