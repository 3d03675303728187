"""Made-up teams to try planners on, without a mission."""

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from planning.planner import Plan, Situation, Vehicle
from tracking.detection.noise import NoiseModel
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.geometry.camera import Camera, Look, Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.track import Track
from tracking.undetected import Intensity


def make_random_team(
    seed: int, *, uavs: int = 3, targets: int = 4, trees: int = 45, spread: float = 25.0
) -> list[Situation]:
    """Situations of a team with equal beliefs, in a random forest.

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
    tracks = []
    for t in range(targets):
        mean = np.r_[rng.uniform(-spread, spread, 2), rng.normal(0, 1.2, 2)]
        root = rng.normal(size=(4, 4)) * np.array([0.8, 0.8, 0.4, 0.4])
        tracks.append(Track(t, Gaussian(mean, root @ root.T + 0.05 * np.eye(4))))
    motion = NearlyConstantVelocity(1.0, 0.5, scans=5)
    return [
        Situation(0.0, v, tuple(w for w in vehicles if w is not v), tuple(tracks), forest, (150.0, 100.0), motion)
        for v in vehicles
    ]


def make_flying_team(seed: int = 0, targets: int = 4) -> list[Situation]:
    """Three quadrotors in flight, each with its own top speed and beliefs; all know the last plans of UAVs 0 and 1."""
    rng, team = np.random.default_rng([seed, 1]), make_random_team(seed, targets=targets)
    fleet = [
        replace(s.own, max_speed=5.0 - k, velocity=np.array([1.0 + 0.5 * k, 0.5]), lag=0.65) for k, s in enumerate(team)
    ]
    intents = {i: Plan(rng.uniform(-2.0, 2.0, (5, 2))) for i in (0, 1)}
    people = [np.where(rng.random((20, 30)) < 0.1, rng.random((20, 30)), 0.0) for _ in fleet]
    return [
        replace(
            s,
            time=12.0,
            own=fleet[k],
            neighbours=tuple(v for v in fleet if v is not fleet[k]),
            tracks=tuple(map(_sight, make_random_team(10 * seed + k, targets=targets)[k].tracks)),
            looks=_look(fleet),
            intents=dict(intents),
            undetected=Intensity(people[k], (-75.0, -50.0), (5.0, 5.0)),
        )
        for k, s in enumerate(team)
    ]


def _sight(track: Track) -> Track:
    """The track, detected at 12 s if its id is even, else 4 s before that."""
    away = 4.0 * (track.id % 2)
    return replace(track, sighting=np.array([*track.belief.mean[:2] - away * track.belief.mean[2:], 12.0 - away]))


def _look(vehicles: Iterable[Vehicle]) -> tuple[Look, ...]:
    return tuple(Look(v.camera, Pose(v.position, v.attitude)) for v in vehicles)


def keep_contact(situation: Situation, ids: Collection[int]) -> Situation:
    """The situation of a UAV that is in contact only with UAVs `ids`."""
    neighbours = tuple(v for v in situation.neighbours if v.id in ids)
    intents = {i: plan for i, plan in situation.intents.items() if i in ids}
    return replace(situation, neighbours=neighbours, intents=intents, looks=_look((situation.own, *neighbours)))


def break_contact(team: Sequence[Situation], uav: int) -> list[Situation]:
    """The team when one UAV is out of contact with the others."""
    others = {s.own.id for s in team} - {uav}
    return [keep_contact(s, {uav} if s.own.id == uav else others) for s in team]


def slow_down(team: Sequence[Situation], uav: int) -> list[Situation]:
    """The team when one UAV can hardly move, so that its plan reveals nothing of its knowledge.

    Its top speed is 1e-20 m/s, too little to change a position, but not zero, because planners may divide by it.
    """
    others = {s.own.id for s in team} - {uav}
    slow = [replace(s, own=replace(s.own, max_speed=1e-20)) if s.own.id == uav else s for s in team]
    fleet = {s.own.id: s.own for s in slow}
    intents = {i: plan for i, plan in team[0].intents.items() if i in others}
    return [replace(s, neighbours=tuple(fleet[v.id] for v in s.neighbours), intents=intents) for s in slow]


def lose_plans(team: Sequence[Situation], uav: int, rounds: int) -> list[Situation]:
    """The team where no other UAV receives one UAV's plan in any round; all positions and last plans are known."""
    heard = [tuple(v.id for v in s.neighbours if v.id != uav) for s in team]
    return [replace(s, reception=(ids,) * rounds) for s, ids in zip(team, heard, strict=True)]
