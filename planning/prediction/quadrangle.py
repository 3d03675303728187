"""Geometry of a field of view on the plane of the targets: a convex quadrangle, see `view_quadrangle`, compiled."""

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled


@compiled
def inside(views: Array, uav: int, dx: float, dy: float) -> bool:
    """True if (dx, dy) m from a UAV is in its field of view; views (n, 5, 3) are the `view_quadrangle` of each UAV."""
    for k in range(4):
        if views[uav, k, 0] * dx + views[uav, k, 1] * dy > views[uav, k, 2]:
            return False
    return True


@compiled
def shortest_move(views: Array, uav: int, dx: float, dy: float) -> tuple[float, float]:
    """Least displacement [m] of a UAV after which its field of view just covers a point at (dx, dy) m from it.

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
    """True if a point (x, y) on side k is on the inner side of the other ones."""
    x, y = point
    for i in range(4):
        if i != k and views[uav, i, 0] * x + views[uav, i, 1] * y > views[uav, i, 2]:
            return False
    return True
