"""Sensor modes, which make detections before noise, misses and false alarms: the interface and the ideal mode."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from sim.scenario.scenario import Scenario
from sim.sensing.cameras import true_view_of
from sim.sensing.fault import Fault
from sim.sensing.stopwatch import Stopwatch
from sim.world.world import World
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, at_target_height, detectable_shares
from tracking.numerics.arrays import Array, Flags, Indices


@dataclass(frozen=True, eq=False)
class SensorSetup:
    """The mission in which a mode senses."""

    scenario: Scenario
    world: World
    forest: Forest
    cameras: list[Camera]  # one per UAV, as the fleet believes them to be
    clock: Stopwatch
    rng: np.random.Generator  # of what the mode draws at random
    believed: dict[int, Pose] = field(default_factory=dict)  # pose of each UAV's camera in its present frame, to itself


@dataclass(frozen=True, eq=False)
class SensorOutput:
    """Detections of one UAV at one scan, and ground truth about them for recordings and metrics only."""

    ground: Array  # (N, 2) m, from the true pose of the camera, or as `located_by_belief` says
    matched: Callable[[Flags], Flags]  # mask (M,) of detected people, given the mask (N,) of detections not missed
    visible: Indices  # (M,) number of pixels that show each person; without images, 1 for each person seen
    covariances: Array | None = None  # (N, 2, 2) m²; if None, a sample of the UAV's noise model is added
    frame: Frame | None = None
    pixels: Array | None = None  # (N, 2), positions of the detections in the frame, if there is one
    faults: tuple[Fault, ...] = ()
    errors: Array | None = None  # (N, 2, 2) m², covariances of the errors before that sample; None means no errors
    located_by_belief: bool = False  # True if `ground` is from the pose that the UAV believes, `SensorSetup.believed`


class SensorMode(Protocol):
    """A mode is made with a `SensorSetup`."""

    def sense(self, uav: int, time: float, pose: Pose, people: Array) -> SensorOutput:
        """Output of a UAV's sensor with the camera at `pose`; people (M, 2) m in the world, NaN if absent."""


@dataclass(frozen=True, eq=False)
class LineOfSightMode:
    """The paper's Assumption 1 without images: UAVs detect exactly the people in view who are not hidden.

    Those whom porous trees hide in part are detected with the probability of `detectable_share`. The error of each
    measurement is a sample of the UAV's noise model.
    """

    setup: SensorSetup

    def sense(self, uav: int, time: float, pose: Pose, people: Array) -> SensorOutput:
        """As `SensorMode.sense`."""
        with self.setup.clock.measure("detection"):
            points, present = at_target_height(np.nan_to_num(people)), ~np.isnan(people[:, 0])
            forest, scenario = self.setup.forest, self.setup.scenario
            camera, believed = true_view_of(scenario.uavs[uav], scenario), self.setup.cameras[uav]
            shown = detectable_shares(forest.free_shares(pose.position, points)[0])
            least = self.setup.rng.random(len(points)) if forest.is_porous else 0.0
            seen = present & camera.sees(pose, points) & (shown > least)

        def matched(kept: Flags) -> Flags:
            found: Flags = seen.copy()
            found[seen] = kept
            return found

        ground = people[seen]
        if believed != camera:  # a person's pixel is taken for that of another place
            ground = believed.ground_points(pose, camera.project(pose, points[seen])[0], TARGET_HEIGHT)
            seen[seen] = placed = np.isfinite(ground[:, 0])
            ground = ground[placed]
        return SensorOutput(ground, matched, seen.astype(np.int64))
