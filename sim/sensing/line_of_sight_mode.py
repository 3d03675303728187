"""Sensor mode without images: every person in the field of view and in line of sight is detected."""

import numpy as np

from sim.sensing.sensor_mode import SensorOutput, SensorSetup
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.arrays import Array, Flags


class LineOfSightMode:
    """The paper's Assumption 1: exactly the people in view and not hidden, with the sampled noise."""

    def __init__(self, setup: SensorSetup) -> None:
        self._setup = setup

    def sense(self, uav: int, time: float, pose: Pose, people: Array) -> SensorOutput:
        """As `SensorMode.sense`."""
        with self._setup.clock.measure("detection"):
            points = np.column_stack([people, np.full(len(people), TARGET_HEIGHT)])
            present = ~np.isnan(people[:, 0])
            points[~present] = 0.0
            camera, forest = self._setup.cameras[uav], self._setup.forest
            seen = present & camera.sees(pose, points) & forest.visible(pose.position, points)[0]

        def matched(kept: Flags) -> Flags:
            found: Flags = seen.copy()
            found[seen] = kept
            return found

        return SensorOutput(people[seen], matched, seen.astype(np.int64))
