"""Situations to try planners on, without a mission: random teams, and changed copies of a team."""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from planning.planner import Plan, Situation, Vehicle
from tracking.detection.noise import NoiseModel
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.geometry.camera import Camera
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array
from tracking.track import Track
from tracking.undetected import Intensity

_DISPLACEMENT = np.array([2.0, -1.0, 0.0])  # m, by which UAVs are displaced
# Kinds of knowledge, and how each is changed.
KNOWLEDGE: dict[str, Callable[[Situation], Situation]] = {
    "tracks": lambda s: replace(s, tracks=tuple(_displaced(t, np.array([3.0, -2.0, 0.5, 0.3]), 4.0) for t in s.tracks)),
    "received intents": lambda s: replace(s, intents={i: Plan(-plan.controls) for i, plan in s.intents.items()}),
    "own measured position and velocity": lambda s: replace(s, own=_moved(s.own, _DISPLACEMENT)),
    "neighbours' positions and velocities": lambda s: replace(
        s, neighbours=tuple(_moved(v, -_DISPLACEMENT) for v in s.neighbours)
    ),
    "people not found": lambda s: replace(
        s, undetected=s.undetected and replace(s.undetected, people=s.undetected.people[::-1].copy())
    ),
}


def random_team(
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


def ordinary_team(seed: int = 0, targets: int = 4) -> list[Situation]:
    """Three quadrotors in flight, each with its own top speed, beliefs and intensity of undetected targets.

    All of them know the last plans of UAVs 0 and 1.
    """
    rng, places = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
    team = random_team(seed, targets=targets)
    fleet = {
        s.own.id: replace(s.own, max_speed=5.0 - s.own.id, velocity=np.array([1.0 + 0.5 * s.own.id, 0.5]), lag=0.65)
        for s in team
    }
    intents = {i: Plan(rng.uniform(-2.0, 2.0, (5, 2))) for i in (0, 1)}
    return [
        replace(
            s,
            time=12.0,
            own=fleet[s.own.id],
            neighbours=tuple(fleet[v.id] for v in s.neighbours),
            tracks=tuple(_displaced(track, rng.normal(0.0, 0.5, 4), 1.0) for track in s.tracks),
            intents=dict(intents),
            undetected=Intensity(
                np.where(places.random((20, 30)) < 0.1, places.random((20, 30)), 0.0), (-75.0, -50.0), (5.0, 5.0)
            ),
        )
        for s in team
    ]


def _moved(vehicle: Vehicle, by: Array) -> Vehicle:
    """The UAV with its position displaced by (3,) m, and its velocity by as much in a second."""
    return replace(vehicle, position=vehicle.position + by, velocity=vehicle.velocity + by[:2])


def _displaced(track: Track, by: Array, times: float) -> Track:
    """The track with its mean displaced by a state (4,) and its covariance multiplied."""
    return replace(track, belief=Gaussian(track.belief.mean + by, times * track.belief.covariance))


def _subteam(team: Sequence[Situation], ids: Collection[int]) -> list[Situation]:
    """The team when only UAVs `ids` still work."""
    return [_in_contact(s, ids) for s in team if s.own.id in ids]


def out_of_contact(team: Sequence[Situation], uav: int) -> list[Situation]:
    """The team when one UAV is out of contact with the others."""
    ids = {s.own.id for s in team}
    return [_in_contact(s, {uav} if s.own.id == uav else ids - {uav}) for s in team]


def immobilised(team: Sequence[Situation], uav: int) -> list[Situation]:
    """The team when one UAV can hardly move, so that its plan reveals nothing of its knowledge.

    Its top speed is 1e-20 m/s, too little to change a position, but not zero, because planners may divide by it.
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


def with_other_knowledge(team: Sequence[Situation], uavs: Collection[int], kinds: Collection[str]) -> list[Situation]:
    """The team when the knowledge of UAVs `uavs` is changed in some kinds of `KNOWLEDGE`; no track is lost or added."""
    changes = [KNOWLEDGE[kind] for kind in kinds]
    return [reduce(lambda known, change: change(known), changes, s) if s.own.id in uavs else s for s in team]


def _in_contact(s: Situation, ids: Collection[int]) -> Situation:
    return replace(
        s,
        neighbours=tuple(v for v in s.neighbours if v.id in ids),
        intents={i: plan for i, plan in s.intents.items() if i in ids},
    )


def _situations() -> dict[str, list[Situation]]:
    team = ordinary_team()
    return {
        "one UAV": _subteam(team, {0}),
        "no tracks": [replace(s, tracks=()) for s in team],
        "no trees": [replace(s, forest=Forest(())) for s in team],
        "a UAV broken down": _subteam(team, {0, 2}),  # so ids differ from indices in the team
        "out of contact": [out_of_contact(team, s.own.id)[k] for k, s in enumerate(team)],
        "first decision": [replace(s, time=0.0, intents={}) for s in team],
        "fifty tracks": ordinary_team(targets=50),
    }


SITUATIONS = _situations()
