"""Random situations for tests of planning."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from planning.planner import Situation, Vehicle
from tracking.camera import Camera
from tracking.kalman import Gaussian, NearlyConstantVelocity
from tracking.noise import NoiseModel
from tracking.tracker import Track
from tracking.visibility import Forest, Tree

Team = Callable[..., list[Situation]]


def _random_covariance(rng: np.random.Generator) -> np.ndarray:
    root = rng.normal(size=(4, 4)) * np.array([0.8, 0.8, 0.4, 0.4])
    return root @ root.T + 0.05 * np.eye(4)


@pytest.fixture
def random_team() -> Team:
    """Situations of a team whose members hold the same beliefs, in a random forest."""

    def make(seed: int, *, uavs: int = 3, targets: int = 4, trees: int = 45, spread: float = 25.0) -> list[Situation]:
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
        motion = NearlyConstantVelocity(1.0, 0.5)
        return [
            Situation(0.0, v, tuple(w for w in vehicles if w is not v), tracks, forest, (150.0, 100.0), motion)
            for v in vehicles
        ]

    return make
