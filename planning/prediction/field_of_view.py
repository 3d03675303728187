"""Field of view of a camera in level flight on the plane of the targets: a quadrangle that moves with its UAV."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from planning.planner import Vehicle
from tracking.geometry.camera import ALL_ROUND, rotation
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.matrices import applied
from tracking.numerics.trigonometry import hypot, tan

_CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
# Points of the image at which to keep a pursued target, in half edges: the middle and eight near the rim. From aside
# a UAV sees under a canopy that hides the target from above.
IMAGE_POINTS = -0.85 * np.array([(x, y) for x in (0, -1, 1) for y in (0, -1, 1)])


class _Sight(NamedTuple):
    """Parameters of a field of view."""

    fov: float
    height: float  # m above the plane of the targets
    attitude: tuple[float, ...]  # quaternion


def points_shown(vehicle: Vehicle, marks: Array) -> Array:
    """Points (K, 2) m from the vehicle that the image shows at `marks` (K, 2), in half edges from its middle.

    Note: a view all round has no image; its marks are those of an image of 90 degrees.
    """
    return _shown_at(_sight(vehicle), marks)


def aim_point(vehicle: Vehicle) -> Array:
    """Point (2,) m from the vehicle that the middle of the image shows."""
    return _aim(_sight(vehicle))


def viewing_range(vehicle: Vehicle) -> float:
    """Longest planar distance at which the vehicle can see a target [m]."""
    if vehicle.camera.fov >= ALL_ROUND:
        return math.inf
    return float(np.max(length(points_shown(vehicle, _CORNERS))))


def view_quadrangle(vehicle: Vehicle) -> Array:
    """The field of view (5, 3): four half-planes (a, b, c) and, in the last row, x and y [m] of its aim.

    (dx, dy) m from the vehicle is inside where a dx + b dy <= c for all four; (a, b) has length 1. A pinhole camera
    sees what has |x| <= tan(fov / 2) depth, and likewise for y; on a plane of constant height that is linear.
    """
    return _quadrangle(_sight(vehicle))


def _sight(vehicle: Vehicle) -> _Sight:
    height = float(vehicle.position[2] - TARGET_HEIGHT)
    return _Sight(vehicle.camera.fov, height, tuple(np.asarray(vehicle.attitude, dtype=float).tolist()))


def _shown_at(sight: _Sight, marks: Array) -> Array:
    half = sight.height * (1.0 if sight.fov >= ALL_ROUND else tan(sight.fov / 2))
    rays = np.column_stack([half * np.asarray(marks), np.full(len(marks), -sight.height)])
    rays = applied(rotation(np.array(sight.attitude)), rays)
    return np.asarray(rays[:, :2] * (sight.height / -rays[:, 2:]))


# A team's UAVs each ask for the fields of view of all of them, at every decision.
@lru_cache(maxsize=1024)
def _aim(sight: _Sight) -> Array:
    return _kept(_shown_at(sight, np.zeros((1, 2)))[0])


@lru_cache(maxsize=1024)
def _quadrangle(sight: _Sight) -> Array:
    if sight.fov >= ALL_ROUND:
        return _kept(np.array([*((x, y, math.inf) for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))), (0, 0, 0)], float))
    slope, R = tan(sight.fov / 2), rotation(np.array(sight.attitude))
    out = np.empty((5, 3))
    for k, (axis, sign) in enumerate(((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0))):
        normal = sign * R[:, axis] + slope * R[:, 2]
        size = hypot(normal[0], normal[1])
        out[k] = normal[0] / size, normal[1] / size, sight.height * normal[2] / size
    out[4] = *_aim(sight), 0.0
    return _kept(out)


def _kept(array: Array) -> Array:
    """The array, made read-only because several callers share it."""
    array.flags.writeable = False
    return array
