"""What a camera in level flight shows of the plane of the targets: a convex quadrangle that moves with its UAV."""

from __future__ import annotations

import math

import numpy as np

from planning.planner import Vehicle
from tracking.camera import ALL_ROUND, rotation
from tracking.compiled import Array, compiled
from tracking.visibility import TARGET_HEIGHT

_CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
# Where in the image to keep a pursued target, in half edges: the middle, and eight places near the rim, because from
# aside a UAV sees under a canopy that hides the target from above.
MARKS = -0.85 * np.array([(x, y) for x in (0, -1, 1) for y in (0, -1, 1)])


def shown_at(vehicle: Vehicle, marks: Array) -> Array:
    """Where what the image shows at `marks` (K, 2) is, in half edges from its middle; (K, 2) m from the vehicle.

    Note: a view all round has no image; its marks are those of an image of 90 degrees.
    """
    height = float(vehicle.position[2] - TARGET_HEIGHT)
    half = height * (1.0 if vehicle.camera.fov >= ALL_ROUND else math.tan(vehicle.camera.fov / 2))
    rays = np.column_stack([half * np.asarray(marks), np.full(len(marks), -height)]) @ rotation(vehicle.attitude).T
    return np.asarray(rays[:, :2] * (height / -rays[:, 2:]))


def aim(vehicle: Vehicle) -> Array:
    """Where the middle of the image is (2,) m from the vehicle."""
    return np.asarray(shown_at(vehicle, np.zeros((1, 2)))[0])


def reach(vehicle: Vehicle) -> float:
    """The longest planar distance at which the vehicle can see a target [m]."""
    if vehicle.camera.fov >= ALL_ROUND:
        return math.inf
    return float(np.max(np.linalg.norm(shown_at(vehicle, _CORNERS), axis=1)))


def quadrangle(vehicle: Vehicle) -> Array:
    """The field of view (5, 3): four half-planes (a, b, c) and, in the last row, x and y [m] of its aim.

    (dx, dy) m from the vehicle is inside where a dx + b dy <= c for all four; (a, b) has length 1. A pinhole camera
    sees what has |x| <= tan(fov / 2) depth, and likewise for y; on a plane of constant height that is linear.
    """
    if vehicle.camera.fov >= ALL_ROUND:
        return np.array([*((x, y, math.inf) for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))), (0, 0, 0)], dtype=float)
    height, slope = float(vehicle.position[2] - TARGET_HEIGHT), math.tan(vehicle.camera.fov / 2)
    R = rotation(vehicle.attitude)
    out = np.empty((5, 3))
    for k, (axis, sign) in enumerate(((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0))):
        normal = sign * R[:, axis] + slope * R[:, 2]
        length = math.hypot(normal[0], normal[1])
        out[k] = normal[0] / length, normal[1] / length, height * normal[2] / length
    out[4] = *aim(vehicle), 0.0
    return out


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
    h = views[uav]
    if inside(views, uav, dx, dy):
        return 0.0, 0.0
    for k in range(4):
        excess = h[k, 0] * dx + h[k, 1] * dy - h[k, 2]
        if excess > 0.0 and _within_others(h, dx - excess * h[k, 0], dy - excess * h[k, 1], k):
            return excess * h[k, 0], excess * h[k, 1]
    x, y = _nearest_corner(h, dx, dy)
    return dx - x, dy - y


@compiled
def _nearest_corner(half_planes: Array, dx: float, dy: float) -> tuple[float, float]:
    """The corner of the quadrangle, whose first two and last two sides are opposite, nearest to (dx, dy) [m]."""
    h = half_planes
    best, corner = np.inf, (dx, dy)
    for j in range(2):
        for k in range(2, 4):
            scale = 1.0 / (h[j, 0] * h[k, 1] - h[k, 0] * h[j, 1])
            x, y = (h[j, 2] * h[k, 1] - h[k, 2] * h[j, 1]) * scale, (h[j, 0] * h[k, 2] - h[k, 0] * h[j, 2]) * scale
            distance = (dx - x) * (dx - x) + (dy - y) * (dy - y)
            if distance < best:
                best, corner = distance, (x, y)
    return corner


@compiled
def _within_others(half_planes: Array, x: float, y: float, k: int) -> bool:
    """Whether (x, y), which lies on side k, is on the inner side of the other ones."""
    for i in range(4):
        if i != k and half_planes[i, 0] * x + half_planes[i, 1] * y > half_planes[i, 2]:
            return False
    return True
