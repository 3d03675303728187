"""Fleets of trackers on networks that change."""

import numpy as np

from helpers.scenes import ABOVE, AWAY, CAMERA, R, scan, tracker
from tracking.fusion.consensus import fuse
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.tracker import Tracker

HALVES = np.kron(np.eye(2), np.ones((2, 2))).astype(bool)  # UAVs 0 and 1, and 2 and 3
WHOLE = np.ones((4, 4), bool)


def fleet(count: int, *initial, **settings) -> list[Tracker]:
    return [tracker(*initial, uav=u, **settings) for u in range(count)]


def ids(trackers: list[Tracker]) -> list[tuple[int, ...]]:
    return [tuple(t.id for t in s.tracks) for s in trackers]


def play(trackers: list[Tracker], k: int, seen: list[list], adjacency: np.ndarray) -> None:
    """One scan, of which each UAV sees some places; None stands for a camera that looks elsewhere."""
    for t, places in zip(trackers, seen, strict=True):
        t.step(scan(k, *(places or []), uav=t.uav, pose=AWAY if places is None else ABOVE))
    fuse(trackers, adjacency, 5)


def look(rng: np.random.Generator, pose: Pose, forest: Forest, places: np.ndarray, detection: float) -> tuple:
    """Flags (M,) of the people at places (M, 2) m that a camera detects, with so much probability in plain view.

    And the measurements of them.
    """
    points = np.column_stack([places, np.full(len(places), TARGET_HEIGHT)])
    seen = CAMERA.sees(pose, points) & forest.visible(pose.position, points)[0] & (rng.random(len(places)) < detection)
    return seen, places[seen] + rng.multivariate_normal(np.zeros(2), R, int(seen.sum()))
