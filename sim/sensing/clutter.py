"""Clutter: false alarms and missed detections, beyond the paper's Assumption 1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.scenario.perception import Sensing
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.poisson import poisson


class Clutter:
    """False alarms, Poisson in number and uniform over the image, and independent misses.

    Each has its own stream, so that neither changes the other or the measurement noise.
    """

    def __init__(self, sensing: Sensing, rng: np.random.Generator) -> None:
        self._expected = sensing.false_alarms
        self._missed = sensing.miss_probability
        self._alarms, self._misses, self._order = rng.spawn(3)

    def kept(self, count: int) -> NDArray[np.bool_]:
        """Mask (count,) of the detections in one frame that are not missed."""
        return np.asarray(self._misses.random(count) >= self._missed)

    def order(self, detections: int, alarms: int) -> NDArray[np.int64]:
        """An order (detections + alarms,) of one frame's detections and then alarms that does not tell these apart."""
        count = detections + alarms
        return self._order.permutation(count) if alarms else np.arange(count)

    def false_alarms(self, camera: Camera, pose: Pose) -> tuple[Array, Array]:
        """Pixels (K, 2) and ground points (K, 2) m of one frame's false alarms; none above the horizon."""
        count = poisson(self._alarms, self._expected)
        pixels = self._alarms.uniform(0.0, camera.pixels, (count, 2))
        falls = camera.rays(pose, pixels)[:, 2] * (TARGET_HEIGHT - pose.position[2]) > 0.0
        return pixels[falls], camera.ground_points(pose, pixels[falls], TARGET_HEIGHT)
