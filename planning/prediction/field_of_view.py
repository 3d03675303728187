"""Field of view of a camera in level flight on the plane of the targets: a quadrangle that moves with its UAV."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from planning.planner import Vehicle
from tracking.geometry.camera import ALL_ROUND, Camera
from tracking.geometry.lens import focal_length
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.quaternions import rotation
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.matrices import apply
from tracking.numerics.trigonometry import hypot

_CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
# Points of the image at which to keep a pursued target, in half edges: the middle and eight near the rim. A view from
# the side shows a target under a canopy that hides it from above.
IMAGE_POINTS = -0.85 * np.array([(x, y) for x in (0, -1, 1) for y in (0, -1, 1)])


class _GroundView(NamedTuple):
    """What a vehicle sees, as of `aim_point`, `viewing_range` and `view_quadrangle`."""

    aim: Array
    reach: float
    quadrangle: Array


def points_shown(vehicle: Vehicle, marks: Array) -> Array:
    """Points (K, 2) m, relative to the vehicle, that the image shows at `marks` (K, 2), half edges from its middle.

    Note: a view all round has no image; marks are taken in an image of 90 degrees instead.
    """
    height = float(vehicle.position[2] - TARGET_HEIGHT)
    return _find_points(vehicle.camera, height, np.array(vehicle.attitude, dtype=float), marks)


def _find_points(camera: Camera, height: float, attitude: Array, marks: Array) -> Array:
    left, right, low, high = camera.bounds if camera.fov < ALL_ROUND else (-1.0, 1.0, -1.0, 1.0)
    half = height * np.array([(right - left) / 2, (high - low) / 2])
    middle = height * np.array([(right + left) / 2, (high + low) / 2])
    rays = np.column_stack([half * marks + middle, np.full(len(marks), -height)])
    points = apply(rotation(attitude), rays)
    return np.asarray(points[:, :2] * (height / -points[:, 2:]))


def aim_point(vehicle: Vehicle) -> Array:
    """Point (2,) m, relative to the vehicle, that the middle of the image shows."""
    return _view_of(vehicle).aim.copy()


def viewing_range(vehicle: Vehicle) -> float:
    """Longest planar distance at which the vehicle can see a target [m]."""
    return _view_of(vehicle).reach


def view_quadrangle(vehicle: Vehicle) -> Array:
    """The field of view (5, 3): four half-planes (a, b, c) and, in the last row, its aim point and a pixel there.

    The last row has x and y [m] of the aim point, and the edge [m] of a pixel there across the optical axis, which is 0
    for all round. A point (dx, dy) m from the vehicle is inside if a dx + b dy <= c for all four; (a, b) has length 1.
    A camera sees points between its `bounds` times their depth; at constant height that is linear. The view through a
    lens has bent edges: this is the upright rectangle inside it, so every point in it is seen.
    """
    return _view_of(vehicle).quadrangle.copy()


def _view_of(vehicle: Vehicle) -> _GroundView:
    attitude = np.asarray(vehicle.attitude, dtype=float)
    return _find_view(vehicle.camera, float(vehicle.position[2] - TARGET_HEIGHT), attitude.tobytes())


@lru_cache(4096)  # because all UAVs of a fleet ask for the same views
def _find_view(camera: Camera, height: float, quaternion: bytes) -> _GroundView:
    attitude = np.frombuffer(quaternion).copy()
    aim = _find_points(camera, height, attitude, np.zeros((1, 2)))[0]
    if camera.fov >= ALL_ROUND:
        sides = [(x, y, math.inf) for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        return _GroundView(aim, math.inf, np.array([*sides, (0, 0, 0)], dtype=float))
    R, out = rotation(attitude), np.empty((5, 3))
    left, right, low, high = camera.bounds
    for k, (axis, sign, slope) in enumerate(((0, 1.0, right), (0, -1.0, -left), (1, 1.0, high), (1, -1.0, -low))):
        normal = sign * R[:, axis] + slope * R[:, 2]
        size = hypot(normal[0], normal[1])
        out[k] = normal[0] / size, normal[1] / size, height * normal[2] / size
    depth = height * R[2, 2] - aim[0] * R[0, 2] - aim[1] * R[1, 2]
    out[4] = *aim, depth / focal_length(camera.optics)
    return _GroundView(aim, float(np.max(length(_find_points(camera, height, attitude, _CORNERS)))), out)
