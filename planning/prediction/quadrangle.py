"""Geometry of a field of view on the plane of the targets: a convex quadrangle, see `view_quadrangle`, compiled."""

import math

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined


@inlined
def inside(view: Array, dx: float, dy: float) -> bool:
    """True if a point (dx, dy) m from a UAV is in its field of view (5, 3), as from `view_quadrangle`.

    There are no branches, so that compiled loops test several lanes at once.
    """
    near = (view[0, 0] * dx + view[0, 1] * dy <= view[0, 2]) & (view[1, 0] * dx + view[1, 1] * dy <= view[1, 2])
    near &= (view[2, 0] * dx + view[2, 1] * dy <= view[2, 2]) & (view[3, 0] * dx + view[3, 1] * dy <= view[3, 2])
    return bool(near)


def radius_in_view(views: Array) -> Array:
    """Radii (...) m of the largest circles in fields of view (..., 5, 3) about their aim points."""
    sides, aim = views[..., :4, :], views[..., 4:, :2]
    nearest = np.min(sides[..., 2] - (sides[..., 0] * aim[..., 0] + sides[..., 1] * aim[..., 1]), axis=-1)
    # This is `nearest` up to rounding. Plans, and so the bytes of recordings, depend on the rounding.
    return np.asarray(np.sqrt(nearest * nearest + nearest * nearest) / math.sqrt(2))


@compiled
def shortest_move(views: Array, uav: int, dx: float, dy: float) -> tuple[float, float]:
    """Least displacement [m] of a UAV after which its field of view just covers a point at (dx, dy) m from it.

    The nearest point of the quadrangle is the foot of the perpendicular on a side if it lies there, else a corner.
    """
    if inside(views[uav], dx, dy):
        return 0.0, 0.0
    for k in range(4):
        a, b = views[uav, k, 0], views[uav, k, 1]
        excess = a * dx + b * dy - views[uav, k, 2]
        if excess > 0.0 and _is_within_others(views, uav, (dx - excess * a, dy - excess * b), k):
            return excess * a, excess * b
    x, y = _find_nearest_corner(views, uav, dx, dy)
    return dx - x, dy - y


@compiled
def _find_nearest_corner(views: Array, uav: int, dx: float, dy: float) -> tuple[float, float]:
    """The corner nearest to (dx, dy) [m] of a quadrangle whose first two sides are opposite, as are its last two."""
    best, nearest = np.inf, (dx, dy)
    for k in range(4):
        i, j = k // 2, 2 + k % 2
        a, b, c = views[uav, i, 0], views[uav, i, 1], views[uav, i, 2]
        e, f, g = views[uav, j, 0], views[uav, j, 1], views[uav, j, 2]
        scale = 1.0 / (a * f - e * b)
        x, y = (c * f - g * b) * scale, (a * g - e * c) * scale
        distance = (dx - x) * (dx - x) + (dy - y) * (dy - y)
        if distance < best:
            best, nearest = distance, (x, y)
    return nearest


@compiled
def _is_within_others(views: Array, uav: int, point: tuple[float, float], k: int) -> bool:
    """True if a point (x, y) on the line of side k is on the inner side of the other three."""
    x, y = point
    for i in range(4):
        if i != k and views[uav, i, 0] * x + views[uav, i, 1] * y > views[uav, i, 2]:
            return False
    return True
