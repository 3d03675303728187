"""Errors of a camera's pose and clock, to first order: where they move a measurement, and how much they add to it."""

import math

import numpy as np

from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.navigation import Navigation
from tracking.numerics.arrays import Array
from tracking.numerics.exponential import exp
from tracking.numerics.matrices import product

ERRORS = 7  # of a UAV: position east, north and up [m], turns about these axes [rad], and offset of the clock [s]


def error_slopes(points: Array, pose: Pose, velocity: Array) -> Array:
    """Derivatives (N, 2, 7) of measurements at points (N, 2) m by the errors of a camera's believed pose.

    velocity (2,) m/s of the camera. People do not move by the offset of the clock, as the image is of the scan's time.
    """
    ray = np.column_stack([points - pose.position[:2], np.full(len(points), TARGET_HEIGHT - pose.position[2])])
    x, y, z = ray.T
    east, north, one = x / z, y / z, np.ones(len(ray))
    return np.stack(
        [
            np.column_stack([one, 0.0 * one, -east, -east * y, z + east * x, -y, velocity[0] * one]),
            np.column_stack([0.0 * one, one, -north, -z - north * y, north * x, x, velocity[1] * one]),
        ],
        axis=1,
    )


def sandwich(slopes: Array, covariance: Array) -> Array:
    """Covariances J P Jᵀ (N, m, m) of slopes J (N, m, k) and a covariance P (k, k) of errors."""
    return product(product(slopes, covariance), slopes.swapaxes(-1, -2))


class ErrorModel:
    """Moments of the errors of a UAV's pose and clock, as its tracker assumes them."""

    def __init__(self, navigation: Navigation) -> None:
        n = self._navigation = navigation
        drift = [n.horizontal_drift, n.horizontal_drift, n.vertical_drift]
        drift += [math.radians(d) for d in (n.tilt_drift_deg, n.tilt_drift_deg, n.yaw_drift_deg)]
        bias = [0.0, 0.0, 0.0, *(math.radians(b) for b in (n.tilt_bias_deg, n.tilt_bias_deg, n.yaw_bias_deg))]
        # An offset that is given is unknown to trackers, but not its size.
        clock = n.clock_deviation if n.clock_offset is None else abs(n.clock_offset)
        self._drift, self._bias = np.square([*drift, 0.0]), np.square([*bias, clock])
        self.variances = self._drift + self._bias  # (7,) of what stays for many scans
        self.noise = np.zeros(ERRORS)  # (7,) variances of what is new at each scan
        self.noise[:3] = np.square([n.horizontal_noise, n.horizontal_noise, n.vertical_noise])

    def correlation(self, elapsed: float) -> Array:
        """Correlation (7,) of the lasting errors at two times, `elapsed` s apart."""
        times = np.repeat([self._navigation.position_time, self._navigation.attitude_time], [3, 4])
        kept = np.array([exp(-elapsed / time) for time in times.tolist()])
        return np.asarray((self._bias + self._drift * kept) / np.maximum(self.variances, 1e-300))
