"""Ground that is not flat: heights on a grid, where rays meet it, and what it adds to errors of places."""

import math
from typing import NamedTuple

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled

_ROUNDING = 1e-6  # m, by which rounding may take a ray below the ground where it enters a cell


class Surface(NamedTuple):
    """Heights at the points of a grid, and bilinear between four of them; nothing is known beyond the outer points.

    Attributes:
        heights: (R, C) m, R and C at least 2; NaN where they are not known.
        column: the column of a place, as coefficients of 1, x and y [m]; the first one is 0.
        row: the row of a place, likewise.
    """

    heights: Array
    column: tuple[float, float, float]
    row: tuple[float, float, float]


@compiled
def _find_grid_place(surface: Surface, x: float, y: float) -> tuple[float, float]:
    """Column and row of a place [m]."""
    (a, b, c), (d, e, f) = surface.column, surface.row
    return a + b * x + c * y, d + e * x + f * y


@compiled
def describe_ground(surface: Surface, x: float, y: float) -> tuple[float, float, float]:
    """Height [m] of the ground at a place [m], and its slopes to the east and to the north; NaN where not known."""
    heights, (column, row) = surface.heights, _find_grid_place(surface, x, y)
    rows, columns = heights.shape
    if not (0.0 <= column <= columns - 1 and 0.0 <= row <= rows - 1):
        return math.nan, math.nan, math.nan
    i, j = min(int(row), rows - 2), min(int(column), columns - 2)
    u, v, first = column - j, row - i, heights[i, j]
    across, down = heights[i, j + 1] - first, heights[i + 1, j] - first
    twist = heights[i + 1, j + 1] - first - across - down
    right, below = across + twist * v, down + twist * u  # slopes per column and per row
    east = right * surface.column[1] + below * surface.row[1]
    return first + across * u + down * v + twist * u * v, east, right * surface.column[2] + below * surface.row[2]


@compiled
def find_ground(surface: Surface, places: Array) -> Array:
    """Heights and slopes (N, 3) at places (N, 2) m, as of `describe_ground`."""
    out = np.empty((len(places), 3))
    for k in range(len(places)):
        out[k, 0], out[k, 1], out[k, 2] = describe_ground(surface, places[k, 0], places[k, 1])
    return out


@compiled
def meet_ground(surface: Surface, eye: Array, rays: Array, above: float) -> Array:
    """Places (N, 2) m where rays (N, 3) from an eye (3,) m first come down to `above` m over the ground; else NaN."""
    out = np.empty((len(rays), 2))
    for k in range(len(rays)):
        ray = rays[k, 0], rays[k, 1], rays[k, 2]
        scale = _follow_ray(surface, (eye[0], eye[1], eye[2] - above), ray)
        out[k, 0], out[k, 1] = eye[0] + scale * ray[0], eye[1] + scale * ray[1]
    return out


@compiled
def _follow_ray(surface: Surface, eye: tuple[float, float, float], ray: tuple[float, float, float]) -> float:
    """The least s > 0 for which eye + s ray is on the ground; NaN if there is none, or it came there from below.

    The ray is followed from cell to cell of the grid. Within one, the gap between ray and ground is quadratic in s.
    """
    heights, (u, v) = surface.heights, _find_grid_place(surface, eye[0], eye[1])
    du = surface.column[1] * ray[0] + surface.column[2] * ray[1]
    dv = surface.row[1] * ray[0] + surface.row[2] * ray[1]
    rows, columns = heights.shape
    if not (0.0 <= u <= columns - 1 and 0.0 <= v <= rows - 1):
        return math.nan
    i, j, start = min(int(v), rows - 2), min(int(u), columns - 2), 0.0
    while 0 <= i < rows - 1 and 0 <= j < columns - 1:
        out_u = (j + (du > 0.0) - u) / du if du != 0.0 else math.inf
        out_v = (i + (dv > 0.0) - v) / dv if dv != 0.0 else math.inf
        end, first = max(start, min(out_u, out_v)), heights[i, j]
        across, down = heights[i, j + 1] - first, heights[i + 1, j] - first
        twist = heights[i + 1, j + 1] - first - across - down
        x, y = u + start * du - j, v + start * dv - i
        gap = eye[2] + start * ray[2] - first - across * x - down * y - twist * x * y
        slope = ray[2] - across * du - down * dv - twist * (x * dv + y * du)
        step = _find_first_root(-twist * du * dv, slope, gap)
        if gap < -_ROUNDING:
            return math.nan
        if gap <= 0.0 or step <= end - start:
            return start + (step if gap > 0.0 else 0.0)
        if out_u <= out_v:
            j += 1 if du > 0.0 else -1
        else:
            i += 1 if dv > 0.0 else -1
        if end == math.inf:
            break
        start = end
    return math.nan


@compiled
def _find_first_root(a: float, b: float, c: float) -> float:
    """The least s > 0 where a s² + b s + c, with c > 0, is 0; infinite if there is none."""
    square = b * b - 4.0 * a * c
    if not square >= 0.0:
        return math.inf
    if b < 0.0:
        return 2.0 * c / (math.sqrt(square) - b)
    return -(b + math.sqrt(square)) / (2.0 * a) if a < 0.0 else math.inf


@compiled
def lay_on_ground(
    surface: Surface, eye: Array, places: Array, above: float, covariances: Array, deviation: float
) -> Array:
    """Covariances (N, 2, 2) m² of places (N, 2) m, at which rays met the ground, from those on level ground there.

    deviation: standard deviation [m] of heights. An error e on level ground moves the ray d from the eye (3,) m. On
    ground with the slope g, the place errs by (I + w gᵀ) e, and by w for each metre that the ground is higher, where
    w = (dx, dy) / (dz - g · (dx, dy)).
    """
    out = np.empty(covariances.shape)
    for k in range(len(places)):
        height, east, north = describe_ground(surface, places[k, 0], places[k, 1])
        x, y, z = places[k, 0] - eye[0], places[k, 1] - eye[1], height + above - eye[2]
        fall = z - east * x - north * y
        x, y = x / fall, y / fall
        a, b, c, d = 1.0 + x * east, x * north, y * east, 1.0 + y * north
        xx, xy, yy = covariances[k, 0, 0], covariances[k, 0, 1], covariances[k, 1, 1]
        variance = deviation * deviation
        out[k, 0, 0] = a * a * xx + 2.0 * a * b * xy + b * b * yy + variance * x * x
        out[k, 1, 1] = c * c * xx + 2.0 * c * d * xy + d * d * yy + variance * y * y
        out[k, 0, 1] = out[k, 1, 0] = a * c * xx + (a * d + b * c) * xy + b * d * yy + variance * x * y
    return out
