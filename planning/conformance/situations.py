"""Random situations to try planners on, without a mission."""

import math
from dataclasses import replace

import numpy as np

from planning.planner import Plan, Situation, Vehicle
from tracking.detection.noise import NoiseModel
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.geometry.camera import Camera
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array
from tracking.track import Track
from tracking.undetected import Intensity


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
    """Three UAVs in flight: each has its own beliefs and top speed, and knows the last plans of two of them.

    Each has its own intensity of undetected targets.
    """
    rng, places = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
    team = random_team(seed, targets=targets)
    fleet = {s.own.id: replace(s.own, max_speed=5.0 - s.own.id) for s in team}
    intents = {i: Plan(rng.uniform(-2.0, 2.0, (5, 2))) for i in (0, 1)}
    return [
        replace(
            s,
            time=12.0,
            own=fleet[s.own.id],
            neighbours=tuple(fleet[v.id] for v in s.neighbours),
            tracks=tuple(displaced(track, rng.normal(0.0, 0.5, 4), 1.0) for track in s.tracks),
            intents=dict(intents),
            unseen=_sprinkled(places),
        )
        for s in team
    ]


def _sprinkled(rng: np.random.Generator) -> Intensity:
    people = np.where(rng.random((20, 30)) < 0.1, rng.random((20, 30)), 0.0)
    return Intensity(people, (-75.0, -50.0), (5.0, 5.0))


def displaced(track: Track, by: Array, times: float) -> Track:
    """The track with its mean displaced by a state (4,) and its covariance multiplied."""
    return replace(track, belief=Gaussian(track.belief.mean + by, times * track.belief.covariance))
