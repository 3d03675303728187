"""A stage: views of six people among three trees, a painted frame, and scans of known accuracy."""

import math
from dataclasses import dataclass

import numpy as np

from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.quaternions import pitch
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import cos_each, sin_each
from tracking.track import Scan

FOREST = Forest((Tree(-9.0, 8.0), Tree(9.0, 9.0), Tree(10.0, -2.0)))
PEOPLE = np.array([(0.0, 0.0), (5.0, 4.0), (-7.0, 2.0), (4.0, -8.0), (-5.0, -7.0), (0.5, 9.0)])
HEADINGS = np.linspace(0.0, 5.0, len(PEOPLE))  # rad
ORDINARY, TILTED, EMPTY = "ordinary", "tilted camera", "no person in view"
_WALK = 1.5  # m/s
_ALTITUDE = 25.0  # m
_ELSEWHERE = np.array([60.0, 40.0])  # m, a place that no camera here sees


@dataclass(frozen=True, eq=False)
class StagedView:
    """A camera at its pose, and where the people (M, 2) m are at time 0: in plain view, or not at all."""

    camera: Camera
    pose: Pose
    people: Array

    def place_people(self, time: float) -> Array:
        """Positions (M, 2) m at a time [s]; people arrive at a walk."""
        return self.people + time * (_WALK * np.column_stack([cos_each(HEADINGS), sin_each(HEADINGS)]))


_COARSE = Camera(math.radians(60), 128)
_LEVEL = Pose.level(0.0, 0.0, _ALTITUDE)
_AHEAD = Pose.level(-12.0, 0.0, _ALTITUDE)
_TO_THE_EAST = Pose(_AHEAD.position, pitch(_AHEAD.quaternion, math.radians(30)))
VIEWS = {
    ORDINARY: StagedView(_COARSE, _LEVEL, PEOPLE),
    "turned and moved": StagedView(_COARSE, Pose.level(2.0, -1.0, _ALTITUDE), PEOPLE),
    "low UAV": StagedView(_COARSE, Pose.level(0.0, 0.0, 15.0), PEOPLE),
    TILTED: StagedView(_COARSE, _TO_THE_EAST, PEOPLE),
    "finer image": StagedView(Camera(math.radians(60), 256), _LEVEL, PEOPLE),
    EMPTY: StagedView(_COARSE, _LEVEL, PEOPLE + _ELSEWHERE),
}


def paint_frame() -> Frame:
    """A frame of 64 pixels in which two people show: one in its middle, and one whom its corner cuts."""
    image = np.zeros((64, 64, 3), dtype=np.uint8)
    image[28:36, 28:36] = (230, 62, 0)
    image[:4, :4] = (230, 62, 0)
    return Frame(0, 0.0, Camera(1.0, 64), Pose.level(0.0, 0.0, 20.0), image)


def make_scan(uav: int, time: float, pose: Pose, measurements: Array) -> Scan:
    """A scan whose measurements (N, 2) m have errors of 0.05 m² each way."""
    return Scan(uav, time, pose, measurements, np.tile(0.05 * np.eye(2), (len(measurements), 1, 1)))
