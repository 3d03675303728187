"""From the world to scans: cameras, images, detections and measurement noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.renderer import Renderer
from sim.scenario import Scenario, Uav
from sim.scoring import matched_people, visible_pixels
from sim.stopwatch import Stopwatch
from sim.world import World
from tracking.camera import Camera, Pose
from tracking.compiled import Array
from tracking.detector import Detections, Frame, detect, visible_shares
from tracking.noise import NoiseModel
from tracking.tracker import Scan
from tracking.visibility import TARGET_HEIGHT, Forest


@dataclass(frozen=True, eq=False)
class Look:
    """One UAV's look at the world: its scan, and beside it what only recordings and metrics may know."""

    scan: Scan
    pixels: Array  # (N, 2) detections in the image
    image: NDArray[np.uint8] | None  # (P, P, 3) RGB; None in ideal sensing
    visible: NDArray[np.int64]  # (M,) pixels the renderer shows of each person; in ideal sensing 1 for seen
    matched: NDArray[np.bool_]  # (M,) people detected
    taken: bool = True  # whether the camera took a frame; without one the scan is empty and says nothing


def camera_of(uav: Uav) -> Camera:
    """The camera that a UAV of the scenario carries."""
    return Camera(math.radians(uav.fov_deg), uav.pixels)


def noise_of(uav: Uav, scenario: Scenario) -> NoiseModel:
    """The measurement noise that the scenario gives a UAV's camera."""
    if scenario.sensing.noise == "range_bearing":
        return NoiseModel.range_bearing(uav.alpha)
    return NoiseModel.camera(camera_of(uav), uav.altitude)


def camera_pose(uav: Uav, body: Pose) -> Pose:
    """Where a UAV's camera is: a gimbal holds it as on a level body that faces east, else it moves with the body.

    At a mounting angle of zero it then looks straight down with north up, else it is pitched towards the body's x.
    """
    carrier = Pose.level(0, 0, 0).quaternion if uav.mount == "gimbal" else body.quaternion
    return Pose(body.position, _pitched(carrier, math.radians(uav.tilt_deg)))


def planned_attitude(uav: Uav, body: Pose) -> Array:
    """Quaternion (4,) of the camera in level flight at the present heading: what planners assume from now on.

    Note: a body-fixed camera without mounting angle is taken as level with north up, whatever the heading.
    """
    heading = 0.0
    if uav.mount == "body" and uav.tilt_deg:
        heading = math.atan2(body.rotation[1, 0], body.rotation[0, 0])
    level = np.array([0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2)])
    return _pitched(level, math.radians(uav.tilt_deg))


def _pitched(quaternion: Array, angle: float) -> Array:
    """A carrier's attitude (4,) followed by a turn about its y that lifts a downward view towards its x."""
    if angle == 0.0:
        return quaternion
    x, y, z, w = quaternion.tolist()
    sin, cos = -math.sin(angle / 2), math.cos(angle / 2)
    return np.array([cos * x - sin * z, cos * y + sin * w, cos * z + sin * x, cos * w - sin * y])


class Sensors:
    """The cameras of a fleet in one world."""

    def __init__(
        self, scenario: Scenario, world: World, forest: Forest, *, rng: np.random.Generator, clock: Stopwatch
    ) -> None:
        self._scenario = scenario
        self._forest = forest
        self._rng = rng
        self._clock = clock
        self._renderer = Renderer(world) if scenario.sensing.mode == "camera" else None
        self.cameras = [camera_of(uav) for uav in scenario.uavs]
        self.noises = [noise_of(uav, scenario) for uav in scenario.uavs]

    def look(self, uav: int, time: float, pose: Pose, people: Array) -> Look:
        """What one camera at `pose` measures; people (M, 2) m, NaN where absent, are those in the world now."""
        if self._renderer is None:
            return self._ideal(uav, time, pose, people)
        camera = self.cameras[uav]
        with self._clock.measure("rendering"):
            rendered = self._renderer.take(uav, time, camera, pose)
        with self._clock.measure("detection"):
            frame = Frame(uav, time, camera, pose, rendered.image)
            found = detect(frame)
            if self._scenario.sensing.noise == "range_bearing":
                scan = self._sampled(uav, time, pose, found.ground)
            else:
                scan = self._calibrated(uav, frame, found)
        visible = visible_pixels(rendered.people, len(people))
        matched = matched_people(found.pixels, rendered.people, len(people))
        return Look(scan, found.pixels, rendered.image, visible, matched)

    @staticmethod
    def rest(uav: int, time: float, pose: Pose, people: Array) -> Look:
        """What stands for a look at a scan in which a camera, slower than the others, takes no frame."""
        nothing = Scan(uav, time, pose, np.zeros((0, 2)), np.zeros((0, 2, 2)))
        unseen = np.zeros(len(people), dtype=np.int64)
        return Look(nothing, np.zeros((0, 2)), None, unseen, unseen > 0, taken=False)

    def _ideal(self, uav: int, time: float, pose: Pose, people: Array) -> Look:
        """The paper's Assumption 1: exactly the people in view and not hidden, with the sampled noise."""
        with self._clock.measure("detection"):
            points = np.column_stack([people, np.full(len(people), TARGET_HEIGHT)])
            present = ~np.isnan(people[:, 0])
            points[~present] = 0.0
            seen = present & self.cameras[uav].sees(pose, points) & self._forest.visible(pose.position, points)[0]
            scan = self._sampled(uav, time, pose, people[seen])
        return Look(scan, np.zeros((0, 2)), None, seen.astype(np.int64), seen)

    def _sampled(self, uav: int, time: float, pose: Pose, ground: Array) -> Scan:
        """Ground points (N, 2) m with a sample of the UAV's noise model added, and its covariances.

        The sample's covariance is that at the point itself; the scan's is that at the measurement, all that is known.
        """
        z = np.array(ground, dtype=float).reshape(-1, 2)
        if len(z):
            roots = np.linalg.cholesky(self._covariances(uav, pose, z))
            z = z + np.einsum("nij,nj->ni", roots, self._rng.standard_normal(z.shape))
        return Scan(uav, time, pose, z, self._covariances(uav, pose, z))

    def _covariances(self, uav: int, pose: Pose, points: Array) -> Array:
        """R (N, 2, 2) m² of the UAV's noise model at points (N, 2) m."""
        R = [self.noises[uav].covariance(pose.position[:2], point) for point in points]
        return np.array(R).reshape(-1, 2, 2)

    @staticmethod
    def _calibrated(uav: int, frame: Frame, found: Detections) -> Scan:
        """Detections as they are, each with the camera's covariance for how much of the person shows."""
        x, y, altitude = frame.pose.position.tolist()
        models = [NoiseModel.camera(frame.camera, altitude, share) for share in visible_shares(frame, found)]
        R = [model.covariance(np.array([x, y]), z) for model, z in zip(models, found.ground, strict=True)]
        return Scan(uav, frame.time, frame.pose, found.ground, np.array(R).reshape(-1, 2, 2))
