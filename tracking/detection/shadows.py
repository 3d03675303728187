"""Shadows of trees, cast from the camera on the plane at people's mid-height, computed row by row.

The shadow of a vertical cylinder is the convex hull of two discs, the shadows of its ends.
"""

import math

import numpy as np

from tracking.detection.clearing import Clearing, Pair, to_clearing_axes
from tracking.geometry.line_of_sight import Vector
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.trigonometry import hypot

Hull = tuple[float, float, float, float, float, float]  # two discs: u, v, radius; u, v, radius


@compiled
def add_shadows(clearing: Clearing, eye: Vector, cylinders: Array, reach: float) -> Clearing:
    """The clearing with the shadows of opaque cylinders (B, 6) within `reach` m of its origin."""
    shadows, count = np.empty((len(cylinders), 7)), 0
    for k in range(len(cylinders)):
        x, y, radius = cylinders[k, 0], cylinders[k, 1], cylinders[k, 2]
        low, high = max(cylinders[k, 3], TARGET_HEIGHT), min(cylinders[k, 4], eye[2] - 1e-3)
        if low > high or cylinders[k, 5] < math.inf:
            continue
        near, far = (eye[2] - TARGET_HEIGHT) / (eye[2] - low), (eye[2] - TARGET_HEIGHT) / (eye[2] - high)
        u0, v0 = to_clearing_axes(clearing, eye[0] + near * (x - eye[0]), eye[1] + near * (y - eye[1]))
        u1, v1 = to_clearing_axes(clearing, eye[0] + far * (x - eye[0]), eye[1] + far * (y - eye[1]))
        du, dv = u1 - u0, v1 - v0
        length = du * du + dv * dv
        s = min(max(-(u0 * du + v0 * dv) / length, 0.0), 1.0) if length > 0.0 else 0.0
        most = reach + radius * far
        u, v = u0 + s * du, v0 + s * dv
        if u * u + v * v > most * most:
            continue
        front = hypot(x - eye[0], y - eye[1]) - radius if cylinders[k, 3] <= TARGET_HEIGHT else 0.0
        for column, value in enumerate((u0, v0, radius * near, u1, v1, radius * far, max(front, 0.0))):
            shadows[count, column] = value
        count += 1
    c = clearing
    return Clearing(c.origin, c.away, c.distance, c.edges, c.footprint, shadows[:count])


@compiled
def intersect_row(hull: Hull, v: float) -> Pair:
    """Interval of u in which the hull of two discs covers the row at v; (inf, -inf) if it does not."""
    u0, v0, r0, u1, v1, r1 = hull
    low, high = math.inf, -math.inf
    if v < min(v0 - r0, v1 - r1) or v > max(v0 + r0, v1 + r1):
        return low, high
    for u, square in ((u0, r0 * r0 - (v - v0) * (v - v0)), (u1, r1 * r1 - (v - v1) * (v - v1))):
        if square >= 0.0:
            half = math.sqrt(square)
            low, high = min(low, u - half), max(high, u + half)
    du, dv, dr = u1 - u0, v1 - v0, r0 - r1
    square = du * du + dv * dv
    if square <= dr * dr:
        return low, high  # one disc within the other
    across = math.sqrt(square - dr * dr)
    for side in (-1.0, 1.0):  # tangents to both discs, by their normals
        x, y = (dr * du - side * across * dv) / square, (dr * dv + side * across * du) / square
        start, end = v0 + r0 * y, v1 + r1 * y
        if min(start, end) <= v <= max(start, end) and start != end:
            u = u0 + r0 * x + (u1 + r1 * x - u0 - r0 * x) * (v - start) / (end - start)
            low, high = min(low, u), max(high, u)
    return low, high


@compiled
def find_openings(clearing: Clearing, v: float, out: Array) -> int:
    """Write the intervals of u in the image and in no shadow into `out` (S + 1, 2); return their number."""
    low, high = -math.inf, math.inf
    for k in range(len(clearing.edges)):
        slope, rest = clearing.edges[k, 0], clearing.edges[k, 1] * v + clearing.edges[k, 2]
        if slope > 0.0:
            low = max(low, -rest / slope)
        elif slope < 0.0:
            high = min(high, -rest / slope)
        elif rest < 0.0:
            return 0
    if low >= high:
        return 0
    out[0, 0], out[0, 1] = low, high
    count = 1
    for k in range(len(clearing.shadows)):
        s = clearing.shadows[k]
        count = _cut(out, count, intersect_row((s[0], s[1], s[2], s[3], s[4], s[5]), v))
    return count


@compiled
def _cut(intervals: Array, count: int, shadow: Pair) -> int:
    """Cut an interval out of the first `count` disjoint intervals, in place; return the new number of intervals."""
    for k in range(count - 1, -1, -1):
        low, high = intervals[k, 0], intervals[k, 1]
        if shadow[1] <= low or shadow[0] >= high:
            continue
        if shadow[0] > low and shadow[1] < high:
            intervals[count, 0], intervals[count, 1] = shadow[1], high
            count += 1
        if shadow[0] > low:
            intervals[k, 1] = shadow[0]
        elif shadow[1] < high:
            intervals[k, 0] = shadow[1]
        else:
            count -= 1
            intervals[k, 0], intervals[k, 1] = intervals[count, 0], intervals[count, 1]
    return count


@compiled
def is_open(clearing: Clearing, u: float, v: float) -> bool:
    """Test if (u, v) is inside the image and in no shadow."""
    for k in range(len(clearing.edges)):
        if clearing.edges[k, 0] * u + clearing.edges[k, 1] * v + clearing.edges[k, 2] < 0.0:
            return False
    for k in range(len(clearing.shadows)):
        s = clearing.shadows[k]
        low, high = intersect_row((s[0], s[1], s[2], s[3], s[4], s[5]), v)
        if low <= u <= high:
            return False
    return True
