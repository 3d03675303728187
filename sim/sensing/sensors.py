"""Scans of a mission: a sensor mode's detections with measurement noise, misses and false alarms."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from sim.scenario.scenario import Scenario
from sim.scenario.sensing import SENSOR_MODES, Sensing
from sim.sensing.renderer import Renderer
from sim.sensing.sensor_mode import LineOfSightMode, SensorMode, SensorOutput, SensorSetup, Shot
from sim.sensing.sensor_output_check import check_output
from sim.world.world import World
from tracking.detection.detection_errors import whole_covariances
from tracking.detection.noise import measurement_covariances
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
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

    def __init__(
        self,
        scenario: Scenario,
        world: World,
        forest: Forest,
        rng: np.random.Generator,
        believed_forest: Forest | None = None,
    ) -> None:
        """`believed_forest`: the map that detectors have; without one, that of the true trees."""
        self._rng = rng
        self._scenario = scenario
        self._renderer = Renderer(world) if scenario.sensing.renders else None
        self._clutter = Clutter(scenario.sensing, rng)
        uavs = range(len(scenario.uavs))
        self.cameras = [scenario.believed_camera(i) for i in uavs]
        self.noises = [scenario.noise_model(i) for i in uavs]
        self._models = np.array([noise.coefficients for noise in self.noises])
        self._name = scenario.sensing.mode
        setup = SensorSetup(scenario, forest, self.cameras, rng.spawn(1)[0], believed_forest or forest)
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
        return self.read_all([shot])[0]

    def read_all(self, shots: Sequence[Shot]) -> list[Reading]:
        """The measurements of exposed shots of one scan, in the order of their UAVs."""
        outputs = self._sense_all(shots)
        places = self._measure(shots, outputs)
        ends = list(accumulate((len(z) for z, _ in places), initial=0))
        drawn = self._clutter.draw_kept(ends[-1])
        kept = [drawn[first:last].nonzero()[0] for first, last in pairwise(ends)]
        return list(map(self._complete, shots, outputs, kept, places))

    @staticmethod
    def rest(shot: Shot) -> Reading:
        """Empty reading at a scan at which the camera takes no frame, which is no negative information."""
        nothing = Scan(shot.uav, shot.time, shot.pose, np.zeros((0, 2)), np.zeros((0, 2, 2)))
        unseen = np.zeros(len(shot.people), dtype=np.int64)
        return Reading(nothing, np.zeros((0, 2)), None, unseen, unseen > 0)

    def _sense_all(self, shots: Sequence[Shot]) -> list[SensorOutput]:
        """Outputs of the mode; InputError if a plug-in mode fails or its output cannot be used."""
        if isinstance(self._mode, LineOfSightMode):
            return self._mode.sense_all(shots) if shots else []
        return [self._sense(shot) for shot in shots]

    def _sense(self, shot: Shot) -> SensorOutput:
        if self._name in SENSOR_MODES.built_in:
            return self._mode.sense(shot)
        with SENSOR_MODES.errors(self._name, "sense", self._mode, "sense"):
            return check_output(self._mode.sense(deepcopy(shot)), shot.people)

    def _measure(self, shots: Sequence[Shot], outputs: Sequence[SensorOutput]) -> list[tuple[Array, Array]]:
        """Measurements (N, 2) m of all detections and their covariances (N, 2, 2) m², by shot.

        They have samples of the UAVs' noise models unless an output forbids it. The sample has the covariance at the
        ground point; the covariance given is that at the measurement, which alone is known.
        """
        noisy = [(shot, output.ground) for shot, output in zip(shots, outputs, strict=True) if output.noise == "added"]
        if noisy:
            ground = np.concatenate([places for _, places in noisy])
            eyes = np.array([shot.pose.position for shot, _ in noisy])
            uavs, ends = [shot.uav for shot, _ in noisy], np.cumsum([len(places) for _, places in noisy])
            z, R = _add_noise(self._models[uavs], eyes, ends, ground, standard_normal(self._rng, ground.shape))
        first, found = 0, []
        for output in outputs:
            places, covariances = output.ground, output.covariances
            if output.noise == "added":
                own = slice(first, first := first + len(places))
                places, covariances = z[own], R[own] if covariances is None else R[own] + covariances
            assert covariances is not None
            found.append((places, covariances))
        return found

    def _complete(self, shot: Shot, output: SensorOutput, kept: Indices, measured: tuple[Array, Array]) -> Reading:
        """The reading of the measurements that are not missed, with false alarms."""
        z, R = measured
        pixels = np.zeros((0, 2)) if output.pixels is None else output.pixels[kept]
        matched = np.zeros(len(shot.people), dtype=np.bool_)
        owners = output.owners[kept]
        matched[owners[owners >= 0]] = True
        places, ground = self._clutter.draw_false_alarms(self.cameras[shot.uav], shot.pose)
        if len(ground):
            z = np.concatenate([z[kept], ground])
            R = np.concatenate([R[kept], self._compute_alarm_covariances(shot, output, ground)])
            pixels = pixels if output.pixels is None else np.concatenate([pixels, places])
            kept = np.arange(len(z))
        if len(ground) or output.frame is None:  # without images the mode's order may reveal identities
            order = self._clutter.draw_order(len(kept))
            kept, pixels = kept[order], pixels[order] if len(pixels) else pixels
        scan = Scan(shot.uav, shot.time, shot.pose, z[kept], R[kept])
        image = None if output.frame is None else output.frame.image
        return Reading(scan, pixels, image, output.visible, matched, output.errors)

    def _compute_alarm_covariances(self, shot: Shot, output: SensorOutput, ground: Array) -> Array:
        """Covariances (K, 2, 2) m² of false alarms at ground points (K, 2) m: those of people in plain view there."""
        eyes = np.repeat([shot.pose.position[:2]], len(ground), axis=0)
        noise = measurement_covariances(np.repeat(self._models[[shot.uav]], len(ground), axis=0), eyes, ground)
        if output.frame is None:
            return np.zeros_like(noise) + noise
        whole = whole_covariances(self.cameras[shot.uav].lens(shot.pose), ground)
        return whole if output.noise == "none" else whole + noise


@compiled
def _add_noise(models: Array, eyes: Array, ends: Indices, ground: Array, drawn: Array) -> tuple[Array, Array]:
    """Measurements (N, 2) m and their covariances (N, 2, 2) m² at ground points (N, 2) m, from normal numbers (N, 2).

    models (C, 7): `NoiseModel.coefficients` of each camera; eyes (C, 3) m: where it is; ends (C,): the number of ground
    points of the cameras up to it.
    """
    rows, here, c = np.empty((len(ground), 7)), np.empty((len(ground), 2)), 0
    for n in range(len(ground)):
        while ends[c] <= n:
            c += 1
        rows[n], here[n, 0], here[n, 1] = models[c], eyes[c, 0], eyes[c, 1]
    roots, z = cholesky_factors(measurement_covariances(rows, here, ground)), ground.copy()
    for n in range(len(z)):
        z[n, 0] += roots[n, 0, 0] * drawn[n, 0] + roots[n, 0, 1] * drawn[n, 1]
        z[n, 1] += roots[n, 1, 0] * drawn[n, 0] + roots[n, 1, 1] * drawn[n, 1]
    return z, measurement_covariances(rows, here, z)
