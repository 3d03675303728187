"""Scans of a mission: a sensor mode's detections with measurement noise, misses and false alarms."""

from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim.scenario.scenario import Scenario
from sim.scenario.sensing import SENSOR_MODES, Sensing
from sim.sensing.renderer import Renderer
from sim.sensing.sensor_mode import SensorMode, SensorOutput, SensorSetup, Shot
from sim.sensing.sensor_output_check import check_output
from sim.world.world import World
from tracking.detection.detection_errors import whole_covariances
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.matrices import apply
from tracking.numerics.normal import standard_normal
from tracking.numerics.poisson import draw_poisson
from tracking.numerics.stacks import cholesky_factors
from tracking.plugins.plugin_error import PluginError
from tracking.track import Scan


class Clutter:
    """False alarms, Poisson in number and uniform over the image, and independent misses.

    Each has its own random stream, so that neither changes the other or the measurement noise.
    """

    def __init__(self, sensing: Sensing, rng: np.random.Generator) -> None:
        self._expected = sensing.false_alarms
        self._missed = sensing.miss_probability
        self._alarms, self._misses, self._order = rng.spawn(3)

    def draw_kept(self, count: int) -> Flags:
        """Mask (count,) of a frame's detections that are not missed."""
        return np.asarray(self._misses.random(count) >= self._missed)

    def draw_order(self, count: int) -> NDArray[np.int64]:
        """Random order (count,) of a scan's measurements, which does not reveal identities."""
        return self._order.permutation(count)

    def draw_false_alarms(self, camera: Camera, pose: Pose) -> tuple[Array, Array]:
        """Pixels (K, 2) and ground points (K, 2) m of one frame's false alarms, all of them below the horizon."""
        count = draw_poisson(self._alarms, self._expected)
        if not count:
            return np.zeros((0, 2)), np.zeros((0, 2))
        pixels = self._alarms.uniform(0.0, camera.size, (count, 2))
        ground = camera.ground_points(pose, pixels, TARGET_HEIGHT)
        falls = ~np.isnan(ground[:, 0])
        return pixels[falls], ground[falls]


@dataclass(frozen=True, eq=False)
class Reading:
    """What one shot gives: a scan, and ground truth for recordings and metrics only."""

    scan: Scan
    pixels: Array  # (N, 2) positions of the measurements in the image; (0, 2) without an image
    image: NDArray[np.uint8] | None  # (H, W, 3) RGB; None without rendering
    visible: Indices  # (M,) as `SensorOutput.visible`
    matched: Flags  # (M,) mask of people whom a measurement shows
    errors: tuple[PluginError, ...] = ()  # of the detector


class Sensors:
    """The sensors of a fleet in one world."""

    def __init__(self, scenario: Scenario, world: World, forest: Forest, rng: np.random.Generator) -> None:
        self._rng = rng
        self._scenario = scenario
        self._renderer = Renderer(world) if scenario.sensing.renders else None
        self._clutter = Clutter(scenario.sensing, rng)
        uavs = range(len(scenario.uavs))
        self.cameras = [scenario.believed_camera(i) for i in uavs]
        self.noises = [scenario.noise_model(i) for i in uavs]
        self._name = scenario.sensing.mode
        setup = SensorSetup(scenario, forest, self.cameras, rng.spawn(1)[0])
        self._mode: SensorMode = SENSOR_MODES.make(self._name, setup)
        self._last = dict[int, Shot]()  # of each UAV

    def expose(self, shot: Shot) -> Shot:
        """The shot with the motion since the UAV's last one and, with images, its frame."""
        uav = self._scenario.uavs[shot.uav]
        before, self._last[shot.uav] = self._last.get(shot.uav), shot
        shot = shot.expose(before, uav.readout)
        if self._renderer is None:
            return shot
        return replace(shot, rendered=self._renderer.take(shot.uav, shot.time, uav.true_camera, shot.true, shot.sweep))

    def read(self, shot: Shot) -> Reading:
        """The measurements of an exposed shot."""
        output = self._sense(shot)
        kept = self._clutter.draw_kept(len(output.ground))
        scan, pixels = self._add_clutter(self._make_scan(shot, output), output, kept)
        matched = np.isin(np.arange(len(shot.people)), output.owners[kept])
        image = output.frame.image if output.frame else None
        return Reading(scan, pixels, image, output.visible, matched, errors=output.errors)

    @staticmethod
    def rest(shot: Shot) -> Reading:
        """Empty reading at a scan at which the camera takes no frame, which is no negative information."""
        nothing = Scan(shot.uav, shot.time, shot.pose, np.zeros((0, 2)), np.zeros((0, 2, 2)))
        unseen = np.zeros(len(shot.people), dtype=np.int64)
        return Reading(nothing, np.zeros((0, 2)), None, unseen, unseen > 0)

    def _sense(self, shot: Shot) -> SensorOutput:
        """Output of the mode; InputError if a plug-in mode fails or its output cannot be used."""
        if self._name in SENSOR_MODES.built_in:
            return self._mode.sense(shot)
        with SENSOR_MODES.errors(self._name, "sense", self._mode, "sense"):
            return check_output(self._mode.sense(deepcopy(shot)), shot.people)

    def _make_scan(self, shot: Shot, output: SensorOutput) -> Scan:
        """Scan of all detections, with a sample of the UAV's noise model unless the output forbids it.

        The sample has the covariance at the ground point; the scan gives that at the measurement, which alone is known.
        """
        if output.noise == "none":
            assert output.covariances is not None
            return Scan(shot.uav, shot.time, shot.pose, output.ground, output.covariances)
        roots = cholesky_factors(self._compute_covariances(shot.uav, shot.pose, output.ground))
        z = output.ground + apply(roots, standard_normal(self._rng, output.ground.shape))
        R = self._compute_covariances(shot.uav, shot.pose, z)
        return Scan(shot.uav, shot.time, shot.pose, z, R if output.covariances is None else R + output.covariances)

    def _add_clutter(self, scan: Scan, output: SensorOutput, kept: Flags) -> tuple[Scan, Array]:
        """The scan without missed detections but with false alarms, and its pixels (N, 2) in the same order.

        A false alarm has the covariance of a person in plain view at its place.
        """
        camera = self.cameras[scan.uav]
        pose = scan.pose
        places, ground = self._clutter.draw_false_alarms(camera, pose)
        whole = np.zeros((len(ground), 2, 2)) if output.frame is None else whole_covariances(camera.lens(pose), ground)
        exact = output.frame is not None and output.noise == "none"
        alarms = whole if exact else whole + self._compute_covariances(scan.uav, pose, ground)
        z, R = np.vstack([scan.measurements[kept], ground]), np.concatenate([scan.covariances[kept], alarms])
        pixels = np.zeros((0, 2)) if output.pixels is None else np.vstack([output.pixels[kept], places])
        if len(ground) or output.frame is None:  # without images the mode's order may reveal identities
            order = self._clutter.draw_order(len(z))
            z, R, pixels = z[order], R[order], pixels[order] if len(pixels) else pixels
        return replace(scan, measurements=z, covariances=R), pixels

    def _compute_covariances(self, uav: int, pose: Pose, points: Array) -> Array:
        """Covariances R (N, 2, 2) m² of the UAV's noise model at points (N, 2) m."""
        R = [self.noises[uav].covariance(pose.position[:2], point) for point in points]
        return np.array(R).reshape(-1, 2, 2)
