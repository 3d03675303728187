"""Poses of tilted cameras."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from tracking.geometry.camera import Pose


def tilted(rng, position, tilt):
    """A camera that looks down, turned at random and tilted by up to `tilt` rad."""
    yaw, axis, angle = *rng.uniform(-math.pi, math.pi, 2).tolist(), rng.uniform(0, tilt)
    return Pose(np.array(position, dtype=float), turned(angle, axis - yaw, yaw))


def turned(angle, axis, yaw=0.0):
    """Quaternion xyzw: tilted by an angle about a level axis, then turned by a yaw."""
    tilt = Rotation.from_rotvec([angle * math.cos(axis), angle * math.sin(axis), 0.0])
    return (Rotation.from_euler("z", yaw) * tilt).as_quat()
