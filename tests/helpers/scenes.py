"""Trackers and scans to play with."""

import math
from dataclasses import replace

import numpy as np

from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.fusion.consensus import fuse
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest
from tracking.parameters import TrackerParameters
from tracking.track import Scan, Track
from tracking.tracker import Tracker

CAMERA = Camera(math.radians(60), 128)
MOTION = NearlyConstantVelocity(0.2, 0.5)
OPEN = Forest(())
R = 0.05 * np.eye(2)
H = np.eye(2, 4)  # what a ground measurement tells of a state
ABOVE = Pose.level(0.0, 0.0, 20.0)  # sees some 11 m each way
AWAY = Pose.level(60.0, 0.0, 20.0)
ALONE = np.zeros((1, 1), bool)


def track(id: int, *state: float, variance: float = 0.05) -> Track:
    return Track(id, Gaussian(np.array(state, float), variance * np.eye(4)))


def scan(k: int, *points, uav: int = 0, pose: Pose = ABOVE) -> Scan:
    z = np.array(points, float).reshape(-1, 2)
    return Scan(uav, 0.2 * k, pose, z, np.tile(R, (len(z), 1, 1)))


class SureTracker(Tracker):
    """A tracker whose UAV believes one forest in all scans."""

    def __init__(self, *arguments, forest: Forest) -> None:
        super().__init__(*arguments)
        self.forest = forest

    def step(self, scan: Scan) -> None:
        super().step(replace(scan, forest=self.forest))


def tracker(*initial: Track, uav: int = 0, forest: Forest = OPEN, **settings) -> Tracker:
    return SureTracker(uav, CAMERA, TrackerParameters(MOTION, **settings), initial, forest=forest)


def play(subject: Tracker, scans) -> list[tuple[int, ...]]:
    """Ids after each scan of a UAV on its own; covariances are checked on the way."""
    out = []
    for s in scans:
        subject.step(s)
        fuse([subject], ALONE, 5)
        check(subject)
        out.append(tuple(t.id for t in subject.tracks))
    return out


def check(subject: Tracker) -> None:
    ids = [t.id for t in subject.tracks]
    assert ids == sorted(set(ids))
    for t in subject.tracks:
        np.testing.assert_array_equal(t.belief.covariance, t.belief.covariance.T)
        assert np.linalg.eigvalsh(t.belief.covariance).min() > 0
