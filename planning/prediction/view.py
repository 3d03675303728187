"""What a camera in level flight shows of the plane of the targets: a convex quadrangle that moves with its UAV."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from planning.planner import Vehicle
from tracking.geometry.camera import ALL_ROUND, rotation
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.compiled import Array, compiled
from tracking.numerics.elementary import hypot, tan
from tracking.numerics.matrices import applied, length

_CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
# Where in the image to keep a pursued target, in half edges: the middle, and eight places near the rim, because from
# aside a UAV sees under a canopy that hides the target from above.
MARKS = -0.85 * np.array([(x, y) for x in (0, -1, 1) for y in (0, -1, 1)])


class _Sight(NamedTuple):
    """What makes a field of view."""

    fov: float
    height: float  # m above the plane of the targets
    attitude: tuple[float, ...]  # quaternion


def shown_at(vehicle: Vehicle, marks: Array) -> Array:
    """Where what the image shows at `marks` (K, 2) is, in half edges from its middle; (K, 2) m from the vehicle.

    Note: a view all round has no image; its marks are those of an image of 90 degrees.
    """
    return _shown_at(_sight(vehicle), marks)


def aim(vehicle: Vehicle) -> Array:
    """Where the middle of the image is (2,) m from the vehicle."""
    return _aim(_sight(vehicle))


def reach(vehicle: Vehicle) -> float:
    """The longest planar distance at which the vehicle can see a target [m]."""
    if vehicle.camera.fov >= ALL_ROUND:
        return math.inf
    return float(np.max(length(shown_at(vehicle, _CORNERS))))


def quadrangle(vehicle: Vehicle) -> Array:
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
    """An array that several are given and nobody can change."""
    array.flags.writeable = False
    return array


@compiled
def inside(views: Array, uav: int, dx: float, dy: float) -> bool:
    """Whether (dx, dy) m from a UAV is in its field of view; views (n, 5, 3) are the `quadrangle` of each UAV."""
    for k in range(4):
        if views[uav, k, 0] * dx + views[uav, k, 1] * dy > views[uav, k, 2]:
            return False
    return True


@compiled
def shortest_move(views: Array, uav: int, dx: float, dy: float) -> tuple[float, float]:
    """Least displacement [m] of a UAV after which its field of view just covers what is at (dx, dy) m from it.

    The nearest point of the quadrangle lies on a side if the foot of the perpendicular does, else in a corner.
    """
    if inside(views, uav, dx, dy):
        return 0.0, 0.0
    for k in range(4):
        a, b = views[uav, k, 0], views[uav, k, 1]
        excess = a * dx + b * dy - views[uav, k, 2]
        if excess > 0.0 and _within_others(views, uav, (dx - excess * a, dy - excess * b), k):
            return excess * a, excess * b
    x, y = _nearest_corner(views, uav, dx, dy)
    return dx - x, dy - y


@compiled
def _nearest_corner(views: Array, uav: int, dx: float, dy: float) -> tuple[float, float]:
    """The corner of the quadrangle nearest to (dx, dy) [m]."""
    best, nearest = np.inf, (dx, dy)
    for k in range(4):
        x, y = corner(views, uav, k)
        distance = (dx - x) * (dx - x) + (dy - y) * (dy - y)
        if distance < best:
            best, nearest = distance, (x, y)
    return nearest


@compiled
def corner(views: Array, uav: int, k: int) -> tuple[float, float]:
    """One of the four corners of a field of view, of which the first two and the last two sides are opposite [m]."""
    i, j = k // 2, 2 + k % 2
    a, b, c = views[uav, i, 0], views[uav, i, 1], views[uav, i, 2]
    e, f, g = views[uav, j, 0], views[uav, j, 1], views[uav, j, 2]
    scale = 1.0 / (a * f - e * b)
    return (c * f - g * b) * scale, (a * g - e * c) * scale


@compiled
def _within_others(views: Array, uav: int, point: tuple[float, float], k: int) -> bool:
    """Whether a point (x, y), which lies on side k, is on the inner side of the other ones."""
    x, y = point
    for i in range(4):
        if i != k and views[uav, i, 0] * x + views[uav, i, 1] * y > views[uav, i, 2]:
            return False
    return True
