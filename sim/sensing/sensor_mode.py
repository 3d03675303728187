"""Sensor modes, which make detections before noise, misses and false alarms: the interface and the ideal mode."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from sim.scenario.scenario import Scenario
from sim.sensing.rolling_shutter import Sweep
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, at_target_height
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.plugins.plugin_error import PluginError
from tracking.registration.pose_errors import move_to_believed

Noise = Literal["added", "none"]


@dataclass(frozen=True, eq=False)
class Rendered:
    """An image and its mask of people; the mask is ground truth, for recordings and tests only."""

    image: NDArray[np.uint8]  # (H, W, 3) RGB
    people: NDArray[np.int32]  # (H, W) index of the person at each pixel, -1 elsewhere


@dataclass(frozen=True, eq=False)
class Shot:
    """One shot of a UAV's camera. True pose, motion and people are ground truth, and show in the detections only.

    Attributes:
        uav: number of the UAV.
        k: number of the scan.
        time: time [s] since the start.
        true: pose of the camera.
        people: (M, 2) m in the world, NaN if absent.
        believed: the pose that the UAV believes its camera to have; None if that is the true one.
        sweep: motion while the image is read out; None if its rows are exposed at once.
        believed_sweep: the same as the UAV believes, without people.
        rendered: the frame and its mask of people; None without images.
    """

    uav: int
    k: int
    time: float
    true: Pose
    people: Array
    believed: Pose | None = None
    sweep: Sweep | None = None
    believed_sweep: Sweep | None = None
    rendered: Rendered | None = None

    @property
    def pose(self) -> Pose:
        """The pose that the UAV believes its camera to have."""
        return self.believed or self.true

    def expose(self, before: "Shot | None", readout: float) -> "Shot":
        """The shot with the motion since the UAV's last one, while its rows are exposed one after another.

        readout: time from the first row to the last [s]; 0 if all are exposed at once.
        """
        if not readout:
            return self
        last, elapsed = before or self, self.time - before.time if before else math.inf
        sweep = Sweep.between((last.true, self.true), (last.people, self.people), elapsed, readout)
        # What the UAV believes holds its own motion, and nothing of people.
        nobody = self.people[:0]
        return replace(
            self,
            sweep=sweep,
            believed_sweep=Sweep.between((last.pose, self.pose), (nobody, nobody), elapsed, readout),
        )

    def locate(self, points: Array) -> Array:
        """Where the UAV believes people at points (N, 2) m to be, as its pose errs; NaN where it sees no ground."""
        return points if self.believed is None else move_to_believed(points, self.true, self.believed)


@dataclass(frozen=True, eq=False)
class SensorSetup:
    """The mission in which a mode senses.

    Attributes:
        scenario: settings of the mission.
        forest: true trees and their model of occlusion.
        cameras: one per UAV, as the fleet believes them to be.
        rng: source of what the mode draws at random.
        believed_forest: the map that UAVs, and so their detectors, believe.
    """

    scenario: Scenario
    forest: Forest
    cameras: list[Camera]
    rng: np.random.Generator
    believed_forest: Forest


@dataclass(frozen=True, eq=False)
class SensorOutput:
    """Detections of one shot, and ground truth about them for recordings and metrics only.

    Attributes:
        ground: (N, 2) m, as the UAV locates them: `Shot.locate` moves true positions there.
        owners: (N,) index of the person whom each detection shows, -1 for none.
        visible: (M,) number of pixels that show each person; without images, 1 for each person seen.
        covariances: (N, 2, 2) m², of the errors of `ground`; None if it has none.
        noise: `"added"`: a sample of the UAV's noise model is added to `ground`, and its covariance to `covariances`;
            `"none"`: both are used as they are.
        frame: the image, if the mode has one.
        pixels: (N, 2), positions of the detections in the frame, if there is one.
        errors: of the detector; each becomes a fault of the mission.
    """

    ground: Array
    owners: Indices
    visible: Indices
    covariances: Array | None = None
    noise: Noise = "added"
    frame: Frame | None = None
    pixels: Array | None = None
    errors: tuple[PluginError, ...] = ()


class SensorMode(Protocol):
    """A mode is made with a `SensorSetup`."""

    def sense(self, shot: Shot) -> SensorOutput:
        """Detections of one shot."""


@dataclass(frozen=True, eq=False)
class LineOfSightMode:
    """The paper's Assumption 1 without images: UAVs detect exactly the people in view who are not hidden.

    People whom porous trees hide in part are detected with the probability of `Forest.detectabilities`. The error of
    each measurement is a sample of the UAV's noise model.
    """

    setup: SensorSetup

    def sense(self, shot: Shot) -> SensorOutput:
        """As `SensorMode.sense`."""
        return self.sense_all([shot])[0]

    def sense_all(self, shots: Sequence[Shot]) -> list[SensorOutput]:
        """Detections of one or more shots of one scan."""
        forest, people = self.setup.forest, shots[0].people
        optics = self._optics[[shot.uav for shot in shots]]
        positions = np.array([shot.true.position for shot in shots], dtype=float)
        quaternions = np.array([shot.true.quaternion for shot in shots], dtype=float)
        shown = forest.find_shown(optics, positions, quaternions, at_target_height(people))
        least = self.setup.rng.random(shown.shape) if forest.is_porous else 0.0
        return [self._locate(shot, seen) for shot, seen in zip(shots, shown > least, strict=True)]

    @cached_property
    def _optics(self) -> Array:
        """`Optics.numbers` (n, 16) of the true cameras."""
        scenario = self.setup.scenario
        return np.array([scenario.true_camera(i).optics.numbers for i in range(len(scenario.uavs))])

    @cached_property
    def _mistaken(self) -> list[bool]:
        """Whether each camera is another than the fleet believes."""
        scenario = self.setup.scenario
        return [scenario.true_camera(i) != camera for i, camera in enumerate(self.setup.cameras)]

    def _locate(self, shot: Shot, seen: Flags) -> SensorOutput:
        """Detections of the people (M,) who are seen."""
        if not self._mistaken[shot.uav]:
            owners = seen.nonzero()[0]
            return SensorOutput(shot.locate(shot.people[owners]), owners, seen.astype(np.int64))
        # Through the lens as believed, a person's pixel shows another place.
        camera, pose = self.setup.scenario.true_camera(shot.uav), shot.true
        pixels, _ = camera.project(pose, at_target_height(shot.people[seen]))
        ground = self.setup.cameras[shot.uav].ground_points(pose, pixels, TARGET_HEIGHT)
        seen[seen] = placed = np.isfinite(ground[:, 0])
        return SensorOutput(shot.locate(ground[placed]), np.flatnonzero(seen), seen.astype(np.int64))
