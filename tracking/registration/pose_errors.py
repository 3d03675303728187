"""Errors of a camera's pose and clock: where they move a measurement, and how much they add to it."""

import numpy as np

from tracking.geometry.camera import Pose, meet_plane
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Array
from tracking.numerics.matrices import apply, product

ERRORS = 7  # of a UAV: position east, north and up [m], turns about these axes [rad], and offset of the clock [s]
CLOCK = 6


def move_to_believed(points: Array, true: Pose, believed: Pose) -> Array:
    """Where people seen at points (N, 2) m by a camera at its true pose are with the believed one; NaN for nowhere."""
    rays = apply(believed.rotation, apply(true.rotation.T, at_target_height(points) - true.position))
    return meet_plane(believed, rays, TARGET_HEIGHT)


def error_slopes(points: Array, pose: Pose, velocity: Array) -> Array:
    """Derivatives (N, 2, 7) of measurements at points (N, 2) m by the errors of a camera's believed pose.

    velocity (2,) m/s of the camera. The offset of the clock does not move people: the image shows the scan's time.
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
