"""Poses of tilted cameras."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from tracking.geometry.camera import Pose


def tilted(rng, position, tilt):
    """A camera that looks down, turned at random and tilted by up to `tilt` rad."""
    yaw, axis, angle = *rng.uniform(-math.pi, math.pi, 2).tolist(), rng.uniform(0, tilt)
    x, y = math.sin(angle / 2) * math.cos(axis), math.sin(angle / 2) * math.sin(axis)
    w, cos, sin = math.cos(angle / 2), math.cos(yaw / 2), math.sin(yaw / 2)
    return Pose(np.array(position, dtype=float), np.array([x * cos + y * sin, y * cos - x * sin, w * sin, w * cos]))


def turned(angle, axis, yaw=0.0):
    """Quaternion xyzw: tilted by an angle about a level axis, then turned by a yaw."""
    tilt = Rotation.from_rotvec([angle * math.cos(axis), angle * math.sin(axis), 0.0])
    return (Rotation.from_euler("z", yaw) * tilt).as_quat()
