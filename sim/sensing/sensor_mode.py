"""Sensor modes, from the world to detections before noise, misses and false alarms: the interface, and geometry."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sim.scenario.scenario import Scenario
from sim.sensing.fault import Fault
from sim.sensing.stopwatch import Stopwatch
from sim.world.world import World
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, at_target_height
from tracking.numerics.arrays import Array, Flags, Indices


@dataclass(frozen=True, eq=False)
class SensorSetup:
    """The mission that a mode senses in."""

    scenario: Scenario
    world: World
    forest: Forest
    cameras: list[Camera]  # of the UAVs
    clock: Stopwatch


@dataclass(frozen=True, eq=False)
class SensorOutput:
    """Detections of one UAV at one scan, and ground truth about them for recordings and metrics alone."""

    ground: Array  # (N, 2) m
    matched: Callable[[Flags], Flags]  # people (M,) detected, by the detections (N,) that are not missed
    visible: Indices  # (M,) pixels that show each person; without pixels 1 for people seen
    covariances: Array | None = None  # (N, 2, 2) m²; None: a sample of the UAV's noise model is added
    frame: Frame | None = None
    pixels: Array | None = None  # (N, 2) of the detections in the frame, if there is one
    faults: tuple[Fault, ...] = ()
    errors: Array | None = None  # (N, 2, 2) m²: covariances of the errors of `ground` before that sample; None: none


class SensorMode(Protocol):
    """A mode is made with a `SensorSetup`."""

    def sense(self, uav: int, time: float, pose: Pose, people: Array) -> SensorOutput:
        """Output of a UAV's sensor at a camera's `pose`; people (M, 2) m, NaN where absent, are those in the world."""


@dataclass(frozen=True, eq=False)
class LineOfSightMode:
    """The paper's Assumption 1, without images: exactly the people in view and not hidden, with the sampled noise."""

    setup: SensorSetup

    def sense(self, uav: int, time: float, pose: Pose, people: Array) -> SensorOutput:
        """As `SensorMode.sense`."""
        with self.setup.clock.measure("detection"):
            points, present = at_target_height(np.nan_to_num(people)), ~np.isnan(people[:, 0])
            camera, forest = self.setup.cameras[uav], self.setup.forest
            seen = present & camera.sees(pose, points) & forest.visible(pose.position, points)[0]

        def matched(kept: Flags) -> Flags:
            found: Flags = seen.copy()
            found[seen] = kept
            return found

        return SensorOutput(people[seen], matched, seen.astype(np.int64))
