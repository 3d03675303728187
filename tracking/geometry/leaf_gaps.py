"""Gaps between leaves: the probability that enough of a person behind a porous crown shows to detect them."""

import math

from tracking.geometry.line_of_sight import Grid, Raster, Vector, cylinder_of, free_share, is_blocked, optical_depth
from tracking.geometry.map_errors import DEVIATION, clear_probability, lower_by_trees
from tracking.geometry.person import AREA_BY_HEIGHT, AREA_ON_TOP, PERSON_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.exponential import exp, log

CLUSTER = 0.8  # m, edge of a cluster of leaves: a flat square in a random direction, as opaque as a closed crown
# m, mean chord of clusters: π times the mean area seen, CLUSTER² / 2, over the mean perimeter seen, π CLUSTER. Source:
# Crofton's formula.
_CHORD = CLUSTER / 2
_ASIDE = 0.2  # m from a person's middle to those of their quarters, which one crown may hide by different shares
# Largest free share of a quarter of a person whose middle is behind leaves, because they stick out of a crown.
_BESIDE = 0.95
USUAL_PIXEL, USUAL_SLOPE = 0.16, 0.4  # m, and horizontal over vertical distance: those of the default cameras
_FINEST = CLUSTER / 10  # m; finer pixels show hardly more people, because they meet the same gaps


@compiled
def detectable_share(free: float, pixel: float = USUAL_PIXEL, slope: float = USUAL_SLOPE) -> float:
    """Probability that enough of a person shows to detect them, given the free share of all lines of sight to them.

    One free pixel is enough. Clusters are at random places (a Boolean model), so neighbouring pixels are both free with
    probability free^(1 + δ), where δ = 1 - exp(-pixel / chord) is the share of the clusters on the line to one that are
    not on the line to the other. The pixels of a square of the person's area are seen one after another: one is free
    though those before it are not with probability τ v, or τ v² beside two rows, with v = (1 - τ^δ) / (1 - τ).
    Source: [Hall88] for Boolean models; the chain of pixels is ours.

    free: τ; pixel: edge of a pixel where the person is, across the line of sight [m]; slope: horizontal over vertical
    distance from the camera.
    """
    if not 0.0 < free < 1.0:
        return free
    return 1.0 - exp(_log_hidden(free, _count_steps(pixel, slope), _find_share_apart(pixel)))


@compiled
def detectability(origin: Vector, point: Vector, pixel: float, cylinders: Array, grid: Grid) -> float:
    """Probability that enough of a person at a point (3,) m shows to detect them from origin (3,) m.

    The law is that of `detectable_share`, with the free share of each quarter of the person. Opaque cylinders hide all
    of the person or nothing; with a seventh column their places err, as in `tracking.geometry.map_errors`, while porous
    ones stay where they are believed. Arguments as of `tracking.geometry.line_of_sight.free_share`.
    """
    errs = cylinders.shape[1] > DEVIATION
    clear = clear_probability(origin, point, cylinders, grid) if errs else 1.0
    free = free_share(origin, point, cylinders, grid, errs) if clear > 0.0 else 0.0
    if not 0.0 < free < 1.0:
        return clear * free
    steps, apart = _count_steps(pixel, _find_slope(origin, point)), _find_share_apart(pixel)
    hidden = 0.0
    for k in range(4):
        part = free_share(origin, _find_quarter(point, k), cylinders, grid, errs)
        hidden += _log_hidden(min(part, _BESIDE), steps, apart)
    return clear * (1.0 - exp(0.25 * hidden))


@inlined
def middle_detectability(origin: Vector, point: Vector, pixel: float, cylinders: Array, grid: Grid) -> float:
    """`detectability` if the free share of a person's middle were that of all of the person.

    At the rims of crowns the two differ, but planners, which ask most, take a fifth of the time. Arguments as of
    `detectability`.
    """
    errs = cylinders.shape[1] > DEVIATION
    clear = clear_probability(origin, point, cylinders, grid) if errs else 1.0
    free = free_share(origin, point, cylinders, grid, errs) if clear > 0.0 else 0.0
    return clear * detectable_share(free, pixel, _find_slope(origin, point))


@inlined
def lower_detectabilities(
    shares: Array, cameras: Array, height: float, point: Vector, pixel: float, cylinders: Array, unknown: Raster
) -> int:
    """Lower shares to the `middle_detectability` of a point for cameras side by side; returns how many become 0.

    shares (L,): 0 or 1 of each camera, changed in place; cameras (2, L) m: their places at one height [m]; point (3,)
    m; cylinders (B, 6 or 7) that may hide the point, of which all are tried; unknown: as of a grid.
    """
    east, north = cameras[0], cameras[1]
    hidden, porous, errs = 0, False, cylinders.shape[1] > DEVIATION
    for k in range(len(cylinders)):
        x, y, radius, bottom, top, extinction = cylinder_of(cylinders, k)
        cylinder, opaque = (x, y, radius, bottom, top, extinction), extinction == math.inf
        porous |= not opaque
        if opaque and errs:
            hidden += lower_by_trees(shares, cameras, height, point, cylinder, cylinders[k, DEVIATION], unknown)
        for lane in range(len(shares) if opaque and not errs else 0):
            if shares[lane] > 0.0 and is_blocked((east[lane], north[lane], height), point, cylinder):
                shares[lane] = 0.0
                hidden += 1
    apart = _find_share_apart(pixel)
    for lane in range(len(shares) if porous else 0):
        if shares[lane] > 0.0:
            origin = east[lane], north[lane], height
            free = _try_all(origin, point, cylinders)
            if 0.0 < free < 1.0:
                free = 1.0 - exp(_log_hidden(free, _count_steps(pixel, _find_slope(origin, point)), apart))
            shares[lane] *= free
    return hidden


@inlined
def _try_all(origin: Vector, point: Vector, cylinders: Array) -> float:
    """`free_share` through leaves without a raster."""
    depth = 0.0
    for k in range(len(cylinders)):
        if cylinders[k, 5] < math.inf:
            depth += optical_depth(origin, point, cylinder_of(cylinders, k), 0.0, 1.0)
    return exp(-depth)


@inlined
def _find_quarter(point: Vector, k: int) -> tuple[float, float, float]:
    """Middle of the quarter of a person at a point (3,) m to the east, north, west or south."""
    aside = _ASIDE if k < 2 else -_ASIDE
    return (point[0] + aside, point[1], point[2]) if k % 2 == 0 else (point[0], point[1] + aside, point[2])


@inlined
def _find_slope(origin: Vector, point: Vector) -> float:
    """Horizontal over vertical distance of two points (3,) m."""
    dx, dy, dz = point[0] - origin[0], point[1] - origin[1], abs(point[2] - origin[2])
    return float(math.sqrt(dx * dx + dy * dy) / max(dz, 1e-9))


@inlined
def _count_steps(pixel: float, slope: float) -> float:
    """Steps of a pixel along an edge of a square of a person's area; arguments as of `detectable_share`."""
    area = (AREA_ON_TOP + AREA_BY_HEIGHT * PERSON_HEIGHT * slope) / math.sqrt(1.0 + slope * slope)
    return max(math.sqrt(area) / max(pixel, _FINEST) - 1.0, 0.0)


@inlined
def _find_share_apart(pixel: float) -> float:
    """The δ of `detectable_share`."""
    return 1.0 - exp(-max(pixel, _FINEST) / _CHORD)


@inlined
def _log_hidden(free: float, steps: float, apart: float) -> float:
    """Logarithm of the probability that no pixel shows a person, from `_count_steps` and `_find_share_apart`."""
    if not free > 0.0:
        return 0.0
    fresh = (1.0 - exp(apart * log(free))) / (1.0 - free)
    return log(1.0 - free) + 2.0 * steps * log(1.0 - free * fresh) + steps * steps * log(1.0 - free * fresh * fresh)
