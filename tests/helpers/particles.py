"""A particle filter of one person hidden under a tree."""

from collections.abc import Iterator

import numpy as np

from helpers.scenes import CAMERA, MOTION
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree

COUNT = 20_000


def start(radius: float, speed: float) -> np.ndarray:
    """A state under a canopy, on the way out."""
    return np.array([-0.2 * radius, 0.0, speed, 0.0])


def hidden(radius: float, speed: float, poses: list[Pose], scans: int, detection: float = 0.99) -> Iterator[np.ndarray]:
    """States (COUNT, 4) after each scan in which no camera, at any of the poses, detects the person."""
    rng, tree = np.random.default_rng(5), Forest((Tree(0.0, 0.0, radius),))
    kick = MOTION.sigma_a * np.kron([[MOTION.dt**2 / 2], [MOTION.dt]], np.eye(2))
    x = rng.multivariate_normal(start(radius, speed), 0.05 * np.eye(4), COUNT)
    for k in range(scans):
        if k:
            x = x @ MOTION.F.T + rng.normal(size=(COUNT, 2)) @ kick.T
        points = np.column_stack([x[:, :2], np.full(COUNT, TARGET_HEIGHT)])
        seen = np.array([CAMERA.sees(p, points) & tree.visible(p.position, points)[0] for p in poses])
        weights = np.prod(1.0 - detection * seen, axis=0)
        steps = (np.arange(COUNT) + rng.random()) / COUNT  # systematic resampling
        x = x[np.searchsorted(np.cumsum(weights / weights.sum()), steps).clip(max=COUNT - 1)]
        yield x
