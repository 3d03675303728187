"""From the world to scans: cameras, images, detections and measurement noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim.scenario.fleet import Uav
from sim.scenario.scenario import Scenario
from sim.sensing.clutter import Clutter
from sim.sensing.detection_truth import matched_people, visible_pixels
from sim.sensing.detectors import load_detector
from sim.sensing.fault import Fault
from sim.sensing.mask_detector import MaskDetector
from sim.sensing.renderer import Rendered, Renderer
from sim.sensing.stopwatch import Stopwatch
from sim.world.world import World
from tracking.detection.detector import Detections, Frame, whole_covariances
from tracking.detection.noise import NoiseModel
from tracking.geometry.camera import ALL_ROUND, Camera, Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest
from tracking.numerics.compiled import Array
from tracking.numerics.elementary import arctan2, cos, sin
from tracking.numerics.matrices import applied, cholesky, eigen
from tracking.numerics.normal import standard_normal
from tracking.plugins.containment import ForeignError, Unusable, contained, numbers
from tracking.tracker import Scan

# Beyond these no detection means anything, and arithmetic suffers.
_FARTHEST, _SUREST = 1e6, 1e-12  # m, m²
_MOST = 200  # detections of a plug-in in one frame: trackers take seconds over so many


@dataclass(frozen=True, eq=False)
class Look:
    """One UAV's look at the world: its scan, and beside it what only recordings and metrics may know."""

    scan: Scan
    pixels: Array  # (N, 2) detections in the image
    image: NDArray[np.uint8] | None  # (P, P, 3) RGB; None in ideal sensing
    visible: NDArray[np.int64]  # (M,) pixels the renderer shows of each person; in ideal sensing 1 for seen
    matched: NDArray[np.bool_]  # (M,) people detected
    taken: bool = True  # whether the camera took a frame; without one the scan is empty and says nothing
    faults: tuple[Fault, ...] = ()  # of the detector


def camera_of(uav: Uav) -> Camera:
    """The camera that a UAV of the scenario carries."""
    return Camera(math.radians(uav.fov_deg), uav.pixels)


def view_of(uav: Uav, scenario: Scenario) -> Camera:
    """The camera that a UAV's measurements are those of: `camera_of`, or one that sees all round."""
    return Camera(ALL_ROUND, uav.pixels) if scenario.sensing.field_of_view == "unlimited" else camera_of(uav)


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
        heading = arctan2(body.rotation[1, 0], body.rotation[0, 0])
    level = np.array([0.0, 0.0, sin(heading / 2), cos(heading / 2)])
    return _pitched(level, math.radians(uav.tilt_deg))


def _pitched(quaternion: Array, angle: float) -> Array:
    """A carrier's attitude (4,) followed by a turn about its y that lifts a downward view towards its x."""
    if angle == 0.0:
        return quaternion
    x, y, z, w = quaternion.tolist()
    s, c = -sin(angle / 2), cos(angle / 2)
    return np.array([c * x - s * z, c * y + s * w, c * z + s * x, c * w - s * y])


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
        self._clutter = Clutter(scenario.sensing, rng)
        # Note: [Li22]'s noise is added to what a camera measures without a map.
        calibrated = scenario.sensing.noise == "camera"
        self._detector = load_detector(scenario.sensing.detector, Forest(forest.trees) if calibrated else None)
        self.cameras = [view_of(uav, scenario) for uav in scenario.uavs]
        self.noises = [noise_of(uav, scenario) for uav in scenario.uavs]

    def look(self, uav: int, time: float, pose: Pose, people: Array) -> Look:
        """What one camera at `pose` measures; people (M, 2) m, NaN where absent, are those in the world now."""
        if self._renderer is None:
            return self._ideal(uav, time, pose, people)
        with self._clock.measure("rendering"):
            rendered = self._renderer.take(uav, time, self.cameras[uav], pose)
        with self._clock.measure("detection"):
            frame = Frame(uav, time, self.cameras[uav], pose, rendered.image)
            found, faults = self._detected(frame, rendered)
            if self._scenario.sensing.noise == "range_bearing":
                scan = self._sampled(uav, time, pose, found.ground)
            else:
                scan = Scan(uav, time, pose, found.ground, found.covariances)
            kept = self._clutter.kept(len(found.ground))
            scan, pixels = self._cluttered(scan, found.pixels, kept, frame)
        visible = visible_pixels(rendered.people, len(people))
        matched = matched_people(found.pixels[kept], rendered.people, len(people))
        return Look(scan, pixels, rendered.image, visible, matched, faults=faults)

    def _detected(self, frame: Frame, rendered: Rendered) -> tuple[Detections, tuple[Fault, ...]]:
        """What the detector finds, and its faults; then nothing is found."""
        if isinstance(self._detector, MaskDetector):
            return self._detector.detect(frame, rendered.people), ()
        try:
            with contained():
                # What a stranger's code does to its frame must not show in scans, recordings and videos.
                pose = Pose(frame.pose.position.copy(), frame.pose.quaternion.copy())
                given = replace(frame, camera=replace(frame.camera), pose=pose, image=frame.image.copy())
                return checked(self._detector.detect(given)), ()
        except ForeignError as error:
            nothing = Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
            return nothing, (Fault(frame.time, frame.uav, f"detector: {error}", error.trace),)

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
            kept = self._clutter.kept(len(scan.measurements))
            scan, _ = self._cluttered(scan, np.zeros((len(kept), 2)), kept, None)
        matched = seen.copy()
        matched[seen] = kept
        return Look(scan, np.zeros((0, 2)), None, seen.astype(np.int64), matched)

    def _cluttered(self, scan: Scan, pixels: Array, kept: NDArray[np.bool_], frame: Frame | None) -> tuple[Scan, Array]:
        """A scan without what is missed, with false alarms among the rest, and its pixels (N, 2), as these were.

        An alarm's covariance is that of a person seen whole in the frame, if one was taken and nothing is added to it.
        """
        places, ground = self._clutter.false_alarms(self.cameras[scan.uav], scan.pose)
        if frame is None or self._scenario.sensing.noise == "range_bearing":
            alarms = self._covariances(scan.uav, scan.pose, ground)
        else:
            alarms = whole_covariances(frame, ground)
        order = self._clutter.order(int(kept.sum()), len(ground))
        z = np.vstack([scan.measurements[kept], ground])[order]
        R = np.concatenate([scan.covariances[kept], alarms])[order]
        return replace(scan, measurements=z, covariances=R), np.vstack([pixels[kept], places])[order]

    def _sampled(self, uav: int, time: float, pose: Pose, ground: Array) -> Scan:
        """Ground points (N, 2) m with a sample of the UAV's noise model added, and its covariances.

        The sample's covariance is that at the point itself; the scan's is that at the measurement, all that is known.
        """
        z = np.array(ground, dtype=float).reshape(-1, 2)
        if len(z):
            roots = cholesky(self._covariances(uav, pose, z))
            z = z + applied(roots, standard_normal(self._rng, z.shape))
        return Scan(uav, time, pose, z, self._covariances(uav, pose, z))

    def _covariances(self, uav: int, pose: Pose, points: Array) -> Array:
        """R (N, 2, 2) m² of the UAV's noise model at points (N, 2) m."""
        R = [self.noises[uav].covariance(pose.position[:2], point) for point in points]
        return np.array(R).reshape(-1, 2, 2)


def checked(found: Detections) -> Detections:
    """Detections that trackers can use, as arrays of floats; `Unusable` says what is wrong with them."""
    pixels, ground = numbers("pixels", found.pixels, 2 * _MOST), numbers("ground", found.ground, 2 * _MOST)
    R = numbers("covariances", found.covariances, 4 * _MOST)
    count = len(ground) if ground.ndim else 0
    for name, array, shape in (("pixels", pixels, (2,)), ("ground", ground, (2,)), ("covariances", R, (2, 2))):
        if count or array.size:
            _check_shape(name, array, (count, *shape))
    if count == 0:
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    for name, array, unit in (("ground", ground, "m"), ("pixels", pixels, "pixels")):
        if np.abs(array).max() > _FARTHEST:
            raise Unusable(f"{name} more than {_FARTHEST:g} {unit} away")
    eigenvalues = eigen(R)[0]
    symmetric = bool(np.all(np.abs(R - np.swapaxes(R, 1, 2)) <= 1e-8 + 1e-5 * np.abs(R)))
    if not symmetric or eigenvalues.min() < _SUREST or eigenvalues.max() > _FARTHEST * _FARTHEST:
        raise Unusable("covariances are not symmetric and positive definite, from 1e-12 to 1e12 m²")
    return Detections(pixels, ground, R)


def _check_shape(name: str, array: Array, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise Unusable(f"{name} of shape {array.shape}, not {shape}")
    if not np.all(np.isfinite(array)):
        raise Unusable(f"{name} are not finite")
