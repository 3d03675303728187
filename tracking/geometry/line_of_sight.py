"""Line of sight between two points: tests of segments against vertical cylinders."""

from __future__ import annotations

import math

from tracking.geometry.tree_grid import PIECE, Grid
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled

Vector = Array | tuple[float, ...]  # in compiled loops tuples take half the time of rows of an array


@compiled
def blocked(origin: Vector, point: Vector, cylinder: Vector) -> bool:
    """Test if the segment from origin (3,) to point (3,) touches the solid cylinder (5,)."""
    dx, dy, dz = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    ox, oy = origin[0] - cylinder[0], origin[1] - cylinder[1]
    length = dx * dx + dy * dy
    across = ox * dy - oy * dx
    if across * across > cylinder[2] * cylinder[2] * length:
        return False  # the whole line is too far from the axis: settles most cases without a division
    start, end = 0.0, 1.0
    if dz == 0.0:
        if origin[2] < cylinder[3] or origin[2] > cylinder[4]:
            return False
    else:
        a, b = (cylinder[3] - origin[2]) / dz, (cylinder[4] - origin[2]) / dz
        start, end = max(start, min(a, b)), min(end, max(a, b))
        if start > end:
            return False
    # Inside the infinite cylinder where |o + s d|² <= r²: nearest point of the remaining piece to the axis.
    s = start if length == 0.0 else min(max(-(ox * dx + oy * dy) / length, start), end)
    x, y = ox + s * dx, oy + s * dy
    return bool(x * x + y * y <= cylinder[2] * cylinder[2])


@compiled
def unobstructed(origin: Vector, point: Vector, cylinders: Array, grid: Grid) -> bool:
    """Test if the segment from origin (3,) to point (3,) misses all cylinders (B, 5)."""
    start, end = _inside(origin, point, grid.low, grid.high)
    if start > end:
        return True
    dx, dy = point[0] - origin[0], point[1] - origin[1]
    length = (end - start) * math.sqrt(dx * dx + dy * dy)
    every = not length <= PIECE * len(cylinders)  # more pieces than cylinders, or not a number
    pieces = 1 if every else int(length / PIECE) + 1
    for k in range(pieces):
        s = start + (end - start) * (k + 0.5) / pieces
        cell = grid.rows * grid.columns if every else _cell(origin[0] + s * dx, origin[1] + s * dy, grid)
        for m in range(grid.starts[cell], grid.starts[cell + 1]):
            row = grid.members[m]
            cylinder = cylinders[row, 0], cylinders[row, 1], cylinders[row, 2], cylinders[row, 3], cylinders[row, 4]
            if blocked(origin, point, cylinder):
                return False
    return True


@compiled
def _cell(x: float, y: float, grid: Grid) -> int:
    """Index of the cell at a place, or of the nearest."""
    row = min(max(int((y - grid.low[1]) / grid.cell), 0), grid.rows - 1)
    column = min(max(int((x - grid.low[0]) / grid.cell), 0), grid.columns - 1)
    return row * grid.columns + column


@compiled
def _inside(origin: Vector, point: Vector, low: Vector, high: Vector) -> tuple[float, float]:
    """The part [start, end] of the segment from origin (3,), 0, to point (3,), 1, in a box; start > end if none is."""
    start, end = 0.0, 1.0
    for axis in range(3):
        o, p, below, above = origin[axis], point[axis], low[axis], high[axis]
        if (o < below and p < below) or (o > above and p > above):
            return 1.0, 0.0
        if o < below or p < below or o > above or p > above:
            a, b = (below - o) / (p - o), (above - o) / (p - o)
            start, end = max(start, min(a, b)), min(end, max(a, b))
    return start, end
