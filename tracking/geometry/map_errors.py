"""Probabilities that lines of sight are free past opaque trees whose places are known with an error, or not at all."""

import math

import numpy as np

from tracking.geometry.line_of_sight import PIECE, Grid, Raster, Vector, clip, cylinder_of, find_cell, value_at
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.exponential import exp
from tracking.numerics.normal import rough_normal_cdf

REACH = 3.0  # standard deviations; places farther off from an edge are taken to be surely beyond it
_LEAST = 1e-6  # probability of a free line of sight that counts
_THIN = 1.6  # deviations; the radius at which both approximations are equally good
# Column of cylinders (B, 7): standard deviation [m] of their places along each axis. The last row may have an infinite
# one: a Poisson field of trees of which the map has none, of which a raster has the number per m².
DEVIATION = 6


@compiled
def hiding_probability(origin: Vector, point: Vector, cylinder: Vector, deviation: float) -> float:
    """Probability that a vertical cylinder touches the segment from origin (3,) to point (3,), within 0.05.

    The place of its axis is normal around that of the cylinder (5 or more,), with a standard deviation [m] along each
    axis. Between the cylinder's bottom and top, the segment is seen from above a line of length l. The cylinder touches
    it if its axis is at most the radius r from that line, in a stadium. Let the believed axis be at (a, b), along and
    across the line, and d from it. Thin cylinders take a rectangle of the stadium's area, wide ones its edge, which
    near the ends of the line is round, so that errors along the edge increase the distance. Of unknown trees, λ per m²,
    none is in the stadium with the probability of an empty area of a Poisson process:

        [Φ((r - b) / σ) - Φ((-r - b) / σ)] [Φ((l + π r / 4 - a) / σ) - Φ((-π r / 4 - a) / σ)]  if r < 1.6 σ, else
        Φ((r - √(d² + c σ²)) / σ)  with  c = 1 - Φ((l - a) / σ) + Φ(-a / σ),
        1 - exp(-λ (π r² + 2 r l))  if σ is infinite.
    """
    start, end = _find_part_beside(origin[2], point[2], cylinder)
    return 0.0 if start > end else _hide(origin, point, cylinder, deviation, start, end)


@inlined
def _find_part_beside(eye: float, target: float, cylinder: Vector) -> tuple[float, float]:
    """Where a line of sight between two heights [m] is beside a cylinder: shares of its length; from 2 if nowhere."""
    low, high, dz = cylinder[3], cylinder[4], target - eye
    if dz == 0.0:
        return (0.0, 1.0) if low <= eye <= high else (2.0, 1.0)
    first, last = (low - eye) / dz, (high - eye) / dz
    start, end = max(0.0, min(first, last)), min(1.0, max(first, last))
    return (start, end) if start <= end else (2.0, 1.0)


@compiled
def _hide(origin: Vector, point: Vector, cylinder: Vector, deviation: float, start: float, end: float) -> float:
    """`hiding_probability` by the part of the segment from `start` to `end`, which is at the cylinder's heights."""
    dx, dy, r = point[0] - origin[0], point[1] - origin[1], cylinder[2]
    x, y = cylinder[0] - origin[0] - start * dx, cylinder[1] - origin[1] - start * dy
    squared = dx * dx + dy * dy
    if deviation == math.inf:
        return 1.0 - exp(-cylinder[0] * r * (math.pi * r + 2.0 * (end - start) * math.sqrt(squared)))
    aside, far = x * dy - y * dx, r + REACH * deviation
    if aside * aside >= far * far * squared > 0.0:
        return 0.0  # most are, which this finds without a root or a quotient
    whole = math.sqrt(squared)
    east, north = (dx / whole, dy / whole) if whole > 0.0 else (1.0, 0.0)
    length, a, b = (end - start) * whole, x * east + y * north, abs(x * north - y * east)
    beyond = max(-a, a - length, 0.0)
    square, reach = beyond * beyond + b * b, REACH * deviation
    if square >= (r + reach) * (r + reach):
        return 0.0
    if r > reach and square <= (r - reach) * (r - reach):
        return 1.0
    if r < _THIN * deviation:
        across = rough_normal_cdf((r - b) / deviation) - rough_normal_cdf((-r - b) / deviation)
        more = 0.25 * math.pi * r
        along = rough_normal_cdf((length + more - a) / deviation) - rough_normal_cdf((-more - a) / deviation)
        return float(across * along)
    round_ = 1.0 - rough_normal_cdf((length - a) / deviation) + rough_normal_cdf(-a / deviation)
    return float(rough_normal_cdf((r - math.sqrt(square + round_ * deviation * deviation)) / deviation))


@inlined
def find_hiding(origin: Vector, point: Vector, cylinder: Vector, deviation: float, unknown: Raster) -> float:
    """`hiding_probability`; the number per m² of unknown trees is that of a raster.

    What counts is the raster's value where the segment is at half the height of the cylinder (6,).
    """
    if deviation != math.inf:
        return hiding_probability(origin, point, cylinder, deviation)
    x, y = origin[0], origin[1]
    _, _, radius, bottom, top, extinction = cylinder
    share = _find_share_at_middle(origin[2], point[2], cylinder)
    density = value_at(unknown, x + share * (point[0] - x), y + share * (point[1] - y))
    if density == 0.0:
        return 0.0
    return hiding_probability(origin, point, (density, 0.0, radius, bottom, top, extinction), math.inf)


@compiled
def lower_by_trees(
    shares: Array, cameras: Array, height: float, point: Vector, cylinder: Vector, deviation: float, unknown: Raster
) -> int:
    """Multiply shares (L,) by the probability that a tree, or unknown ones, leave a line of sight free.

    That is one minus `find_hiding`. Less than `_LEAST` is 0; the result is how many become that. cameras (2, L) m:
    their places at one height [m]; point (3,) m.
    """
    start, end = _find_part_beside(height, point[2], cylinder)
    if start > end:
        return 0
    if deviation == math.inf:
        free = _find_free_of_unknown(cameras, height, point, cylinder, unknown, end - start)
    else:
        free = np.empty(0)
    hidden = 0
    for lane in range(len(shares)):
        if not shares[lane] > 0.0:
            continue
        if len(free) > 0:
            shares[lane] *= free[lane]
        else:
            origin = cameras[0, lane], cameras[1, lane], height
            shares[lane] *= 1.0 - _hide(origin, point, cylinder, deviation, start, end)
        if shares[lane] < _LEAST:
            shares[lane] = 0.0
            hidden += 1
    return hidden


@compiled
def _find_free_of_unknown(
    cameras: Array, height: float, point: Vector, cylinder: Vector, unknown: Raster, part: float
) -> Array:
    """Probabilities (L,) that no unknown tree hides a point; loops by themselves are done with vector instructions.

    part: share of the line of sight that is beside the cylinder.
    """
    east, north, radius = cameras[0], cameras[1], cylinder[2]
    out, share = np.empty(len(east)), _find_share_at_middle(height, point[2], cylinder)
    for lane in range(len(east)):
        dx, dy = point[0] - east[lane], point[1] - north[lane]
        out[lane] = radius * (math.pi * radius + 2.0 * part * math.sqrt(dx * dx + dy * dy))
    for lane in range(len(east)):
        x, y = east[lane], north[lane]
        out[lane] *= value_at(unknown, x + share * (point[0] - x), y + share * (point[1] - y))
    for lane in range(len(east)):
        out[lane] = exp(-out[lane])
    return out


@inlined
def _find_share_at_middle(eye: float, target: float, cylinder: Vector) -> float:
    """Share of a line of sight between two heights [m] at half the height of a cylinder; its end if that is level."""
    dz = target - eye
    return 1.0 if dz == 0.0 else min(max((0.5 * (cylinder[3] + cylinder[4]) - eye) / dz, 0.0), 1.0)


@inlined
def clear_probability(origin: Vector, point: Vector, cylinders: Array, grid: Grid) -> float:
    """Probability that no opaque one of cylinders (B, 7) touches the segment from origin (3,) to point (3,).

    Their errors are independent. The grid is over the cylinders with radii that are larger by `REACH` deviations.
    Note: a tree's trunk and crown move together, and here independently. A line that meets both is hidden anyway.
    """
    clear, last = 1.0, len(cylinders) - 1
    if last >= 0 and cylinders[last, DEVIATION] == math.inf:
        clear = 1.0 - find_hiding(origin, point, cylinder_of(cylinders, last), math.inf, grid.unknown)
    start, end = clip(origin, point, grid.low, grid.high)
    if start > end:
        return clear
    dx, dy = point[0] - origin[0], point[1] - origin[1]
    length = (end - start) * math.sqrt(dx * dx + dy * dy)
    every = not length <= PIECE * len(cylinders)
    pieces = 1 if every else int(length / PIECE) + 1
    for k in range(pieces):
        s = start + (end - start) * (k + 0.5) / pieces
        cell = grid.rows * grid.columns if every else find_cell(origin[0] + s * dx, origin[1] + s * dy, grid)
        for m in range(grid.starts[cell], grid.starts[cell + 1]):
            row = grid.members[m]
            cylinder = cylinder_of(cylinders, row)
            if cylinder[5] == math.inf and (
                pieces == 1 or _find_piece(origin, point, cylinder, start, end, pieces) == k
            ):
                clear *= 1.0 - hiding_probability(origin, point, cylinder, cylinders[row, DEVIATION])
                if clear < 1e-6:
                    return 0.0
    return clear


@inlined
def _find_piece(origin: Vector, point: Vector, cylinder: Vector, start: float, end: float, pieces: int) -> int:
    """The piece of a segment where it comes nearest to a cylinder, which several pieces may have in their lists.

    start, end: the part of the segment that is cut into pieces; only that at the cylinder's heights counts.
    """
    dx, dy, dz = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    nearest = ((cylinder[0] - origin[0]) * dx + (cylinder[1] - origin[1]) * dy) / (dx * dx + dy * dy)
    if dz != 0.0:
        low, high = (cylinder[3] - origin[2]) / dz, (cylinder[4] - origin[2]) / dz
        nearest = min(max(nearest, min(low, high)), max(low, high))
    share = (min(max(nearest, start), end) - start) / (end - start)
    return min(int(share * pieces), pieces - 1)
