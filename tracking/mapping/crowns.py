"""Crowns as circles in the evidence of heights: found by their edges, and measured by their edge in each direction."""

import math
from typing import NamedTuple

import numpy as np

from tracking.mapping.parallax import KNOWN, UNIT, Evidence, Sums, find_cell, level_of
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.factorisation import inverses
from tracking.numerics.trigonometry import cos_each, sin_each

LARGEST = 9.0  # m, radius of crowns that are found
_SMALLEST = 0.75  # m
_STEP = 0.5  # m, between radii and between centres that are tried
_SHARE = 0.35  # of the evidence of the plainest cells, beyond which a cell is taken to be high
_FAINT, _SURE = 0.6, 2.5  # grey levels; bounds of that
_MOST = 8.0  # grey levels; less evidence than minus this, or more than three times as much, counts as this
_BLUR = 0.3  # cells by which edges appear too far outside, as neighbours are compared together
_SECTORS = 48  # directions in which edges are looked for
_TURNS = 2.0 * math.pi * np.arange(_SECTORS) / _SECTORS
_DIRECTIONS = np.column_stack([cos_each(_TURNS), sin_each(_TURNS)])
_ROUNDS = 4  # of finding edges and fitting a circle
_REACH = 1.5  # m from the supposed edge in which it is looked for, at first
_TOLERANCE = 0.3  # m; edges farther off count less
_EDGE = 0.15  # m, standard deviation of an edge that is expected
_ALIKE = 5.5  # directions that err alike
_FEWEST = 10  # edges of a circle that is looked at
_RIM = 4.0  # m of its rim that have to be seen, or three quarters of it


class Crown(NamedTuple):
    """A crown, measured."""

    x: float  # m
    y: float  # m
    radius: float  # m
    base: float  # m, NaN if its side was not seen
    top: float  # m
    capped: bool  # True if more height above its top was compared; else it may be higher
    covariance: Array  # (3, 3) m², of x, y and radius
    rim: float  # share of directions in which its edge was seen
    filled: float  # share of the known cells inside that are high


class Window(NamedTuple):
    """Cells of the ground: rows and columns from the first to before the last."""

    row: int
    column: int
    last_row: int
    last_column: int


@compiled
def find_edges(e: Evidence, window: Window) -> Array:
    """Edges (N, 4) of high regions in a window: x, y [m] and the unit vector inwards; says which cells are high."""
    levels, sure = _find_levels(e.sums, e.counts, window)
    rows, columns = levels.shape
    edges, found = np.empty((rows * columns, 4)), 0
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            e.high[window.row + i, window.column + j] = levels[i, j] > sure
            if not levels[i, j] > sure:
                continue
            east, west, north, south = levels[i, j + 1], levels[i, j - 1], levels[i + 1, j], levels[i - 1, j]
            right, up = east - west, north - south
            size = math.sqrt(right * right + up * up)
            if size > 0.0 and min(min(east, west), min(north, south)) <= sure:
                edges[found, 0] = e.corner[0] + (window.column + j + 0.5) * e.cell
                edges[found, 1] = e.corner[1] + (window.row + i + 0.5) * e.cell
                edges[found, 2], edges[found, 3] = right / size, up / size
                found += 1
    return edges[:found].copy()


@compiled
def _find_levels(sums: Sums, counts: Sums, window: Window) -> tuple[Array, float]:
    """The most evidence for any height in each cell of a window, as the mean of it and its neighbours; NaN if unknown.

    Also the level beyond which a cell is high: a share of what the plainest cells have, as light and leaves differ.
    Levels far from it count as if they were nearer.
    """
    rows, columns = window.last_row - window.row, window.last_column - window.column
    most = np.full((rows, columns), math.nan)
    for k in range(1, len(counts)):
        for i in range(rows):
            for j in range(columns):
                count = counts[k, window.row + i, window.column + j]
                level = sums[k, window.row + i, window.column + j] / (UNIT * max(count, 1))
                if count >= KNOWN and not level <= most[i, j]:
                    most[i, j] = level
    known = np.where(np.isnan(most), 0.0, 1.0)
    ranked = np.sort(most[::2, ::2].ravel())  # of every fourth cell, which takes a fourth of the time; NaN are last
    count = len(ranked) - np.isnan(ranked).sum()
    plain = ranked[int(0.95 * count)] if count > 0 else 0.0
    sure = min(max(_SHARE * plain, _FAINT), _SURE)
    most = np.where(known > 0.0, np.minimum(np.maximum(most, -sure), 3.0 * sure), 0.0)
    total, number = np.zeros((rows, columns)), np.zeros((rows, columns))
    for i in range(1, rows - 1):
        for j in range(columns):
            total[i, j] = most[i - 1, j] + most[i, j] + most[i + 1, j]
            number[i, j] = known[i - 1, j] + known[i, j] + known[i + 1, j]
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            count = number[i, j - 1] + number[i, j] + number[i, j + 1]
            mean = (total[i, j - 1] + total[i, j] + total[i, j + 1]) / count
            most[i, j] = mean if count >= 6.0 else math.nan
    return most, sure


@compiled
def propose(edges: Array) -> Array:
    """Circles (N, 4) for which edges (M, 4) vote, the best first: votes, x, y and radius [m].

    Each edge votes for the centres of all radii along its normal; the votes of neighbouring centres add up.
    """
    if len(edges) == 0:
        return np.zeros((0, 4))
    x, y = edges[:, 0].min() - LARGEST, edges[:, 1].min() - LARGEST
    rows, columns = (
        int((edges[:, 1].max() + LARGEST - y) / _STEP) + 2,
        int((edges[:, 0].max() + LARGEST - x) / _STEP) + 2,
    )
    radii = int((LARGEST - _SMALLEST) / _STEP) + 1
    sums = _count_votes(edges, x, y, np.zeros((radii, rows, columns), dtype=np.int32))
    found = [(0, 0.0, 0.0, 0.0) for _ in range(0)]
    for s in range(radii):
        for i in range(1, rows - 1):
            for j in range(1, columns - 1):
                if sums[s, i, j] >= _FEWEST and sums[s, i, j] == sums[s, i - 1 : i + 2, j - 1 : j + 2].max():
                    found.append((-sums[s, i, j], x + (j + 0.5) * _STEP, y + (i + 0.5) * _STEP, _SMALLEST + s * _STEP))
    found.sort()
    out = np.empty((len(found), 4))
    for n in range(len(found)):
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = -found[n][0], found[n][1], found[n][2], found[n][3]
    return out


@compiled
def _count_votes(edges: Array, x: float, y: float, votes: Sums) -> Sums:
    """Votes (radii, rows, columns) of edges (N, 4) for circles with their neighbours; x, y [m] is the corner."""
    radii, rows, columns = votes.shape
    for n in range(len(edges)):
        for s in range(radii):
            far = _SMALLEST + s * _STEP
            east, north = edges[n, 0] + far * edges[n, 2], edges[n, 1] + far * edges[n, 3]
            votes[s, int((north - y) / _STEP), int((east - x) / _STEP)] += 1
    sums = np.zeros_like(votes)
    for s in range(radii):
        for i in range(1, rows - 1):
            for j in range(1, columns - 1):
                if votes[s, i, j] > 0:
                    for a in range(i - 1, i + 2):
                        sums[s, i, j] += votes[s, a, j - 1] + votes[s, a, j] + votes[s, a, j + 1]
    return sums


def find_crowns(e: Evidence, window: Window, prior: tuple[float, float]) -> list[Crown]:
    """Crowns whose edges lie in a window, those with the longest ones first; prior: mean [m] and variance of radii."""
    edges, found = find_edges(e, window), list[Crown]()
    left = np.ones(len(edges), dtype=np.bool_)
    for x, y, radius in propose(edges)[:, 1:].tolist():
        near = _are_near(edges, x, y, radius) & left
        if np.count_nonzero(near) < _FEWEST:
            continue
        crown = measure(e, x, y, radius, prior)
        if _is_plain(crown, prior) and not any(is_same(crown, other) for other in found):
            found.append(crown)
            near |= _are_near(edges, crown.x, crown.y, -1.0, crown.radius + 0.75)
        left &= ~near
    return found


def _is_plain(crown: Crown, prior: tuple[float, float]) -> bool:
    seen = crown.rim * 2.0 * math.pi * crown.radius >= _RIM or crown.rim >= 0.75
    usual = crown.rim >= 0.6 or abs(crown.radius - prior[0]) < 4.0 * math.sqrt(prior[1] + 0.04)
    return seen and usual and crown.filled >= 0.2


def is_same(one: Crown, other: Crown) -> bool:
    """True if two crowns are so near that they have to be one."""
    east, north = one.x - other.x, one.y - other.y
    return math.sqrt(east * east + north * north) < 0.8 * max(one.radius, other.radius)


@compiled
def _are_near(edges: Array, x: float, y: float, radius: float, reach: float = 0.5) -> Flags:
    """Mask of the edges within a reach of a circle; with a negative radius, within a disc of that reach."""
    out = np.empty(len(edges), dtype=np.bool_)
    for n in range(len(edges)):
        east, north = edges[n, 0] - x, edges[n, 1] - y
        far = math.sqrt(east * east + north * north)
        out[n] = abs(far - max(radius, 0.0)) <= reach
    return out


@compiled
def measure(e: Evidence, x: float, y: float, radius: float, prior: tuple[float, float]) -> Crown:
    """Measure a crown near a circle; prior: mean [m] and variance of radii."""
    covariance, top, half, capped, found = np.full((3, 3), math.nan), math.nan, 0.0, False, 0
    points = np.empty((len(_DIRECTIONS), 2))
    reach = _REACH
    for _ in range(_ROUNDS):
        top, half, capped = _find_top(e, _profile(e, x, y, 0.0, 0.8 * radius))
        if math.isnan(top):
            break
        found = 0
        for n in range(len(_DIRECTIONS)):
            d = (_DIRECTIONS[n, 0], _DIRECTIONS[n, 1])
            far = _find_end(e, top, half, (x, y), (max(0.3 * radius, radius - reach), radius + reach), d)
            if not math.isnan(far):
                points[found, 0], points[found, 1] = x + far * d[0], y + far * d[1]
                found += 1
        for _ in range(3):
            x, y, radius = _fit(points[:found], x, y, radius, prior, covariance)
        reach = max(0.7 * reach, 0.8)
    filled = _find_filled(e, top, 0.5 * half, x, y, radius) if found > 0 else 0.0
    base = _find_base(e, _profile(e, x, y, radius - 0.4, radius + 0.1), top) if found > 0 else math.nan
    return Crown(x, y, radius, base, top, capped, covariance, found / len(_DIRECTIONS), filled)


@compiled
def _profile(e: Evidence, x: float, y: float, inner: float, outer: float) -> Array:
    """Mean evidence (K,) in a ring for each height; NaN where too few cells are known."""
    sums, counts = np.zeros(len(e.heights)), np.zeros(len(e.heights))
    low, high = find_cell(e, x - outer, y - outer), find_cell(e, x + outer, y + outer)
    for i in range(low[0], high[0] + 1):
        for j in range(low[1] + i % 2, high[1] + 1, 2):
            right, up = (j + 0.5) * e.cell + e.corner[0] - x, (i + 0.5) * e.cell + e.corner[1] - y
            if inner * inner <= right * right + up * up <= outer * outer:
                for k in range(1, len(e.heights)):
                    level = level_of(e.sums, e.counts, k, i, j)
                    if not math.isnan(level):
                        sums[k] += max(-_MOST, min(3.0 * _MOST, level))
                        counts[k] += 1.0
    for k in range(len(sums)):
        sums[k] = sums[k] / counts[k] if counts[k] >= 8.0 else math.nan
    return sums


@compiled
def _find_top(e: Evidence, profile: Array) -> tuple[float, float, bool]:
    """Height [m] with the most evidence (K,), by a parabola through its neighbours; half of that; if more is known.

    Both are NaN if there is none.
    """
    best = 0
    for k in range(1, len(profile)):
        if not math.isnan(profile[k]) and (best == 0 or profile[k] > profile[best]):
            best = k
    if best == 0 or not profile[best] >= _FAINT:
        return math.nan, math.nan, False
    top = e.heights[best]
    if 1 < best < len(profile) - 1:
        below, above = profile[best - 1], profile[best + 1]
        bend = 2.0 * profile[best] - below - above
        if bend > 0.0:
            shift = 0.5 * (above - below) / bend
            top += abs(shift) * (e.heights[best + (1 if shift > 0.0 else -1)] - top)
    return top, 0.5 * profile[best], best < len(profile) - 1 and not math.isnan(profile[best + 1])


@inlined
def _level_at(e: Evidence, height: float, x: float, y: float) -> float:
    """Mean evidence at a place, interpolated between heights; NaN where unknown."""
    k = 1
    while k < len(e.heights) - 2 and e.heights[k + 1] < height:
        k += 1
    share = min(max((height - e.heights[k]) / (e.heights[k + 1] - e.heights[k]), 0.0), 1.0)
    row, column = find_cell(e, x, y)
    low, high = level_of(e.sums, e.counts, k, row, column), level_of(e.sums, e.counts, k + 1, row, column)

    level = high if share > 0.9 else low if share < 0.1 else (1.0 - share) * low + share * high
    return float(level)


@compiled
def _find_end(
    e: Evidence,
    top: float,
    half: float,
    centre: tuple[float, float],
    span: tuple[float, float],
    direction: tuple[float, float],
) -> float:
    """Distance [m] from a centre, within a span, at which a crown ends in a direction; NaN if that is not seen.

    There, the sum of evidence beyond half of the crown's own has its maximum.
    """
    step = 0.5 * e.cell
    count = int((span[1] - span[0]) / step)
    best, end, total, known = 0.0, math.nan, 0.0, 0
    for n in range(count):
        far = span[0] + (n + 0.5) * step
        level = _level_at(e, top, centre[0] + far * direction[0], centre[1] + far * direction[1])
        if not math.isnan(level):
            known += 1
            total += max(-half, min(half, level - half))
            if total > best:
                best, end = total, far + 0.5 * step
    return end - _BLUR * e.cell if min(best, best - total) >= 2.0 * half and 4 * known >= 3 * count else math.nan


@compiled
def _fit(
    points: Array, x: float, y: float, radius: float, prior: tuple[float, float], covariance: Array
) -> tuple[float, float, float]:
    """One step of a robust fit of a circle to points (N, 2) and the prior; writes its covariance (3, 3)."""
    A, b = np.zeros((1, 3, 3)), np.zeros(3)
    squares, weights = 4.0 * _EDGE * _EDGE, 4.0
    for n in range(len(points)):
        right, up = points[n, 0] - x, points[n, 1] - y
        far = max(math.sqrt(right * right + up * up), 1e-6)
        error = far - radius
        w = 1.0 / (1.0 + error * error / (_TOLERANCE * _TOLERANCE))
        slope = (right / far, up / far, 1.0)
        for p in range(3):
            b[p] += w * slope[p] * error
            for q in range(3):
                A[0, p, q] += w * slope[p] * slope[q]
        squares += w * error * error
        weights += w
    variance = squares / weights
    for p in range(3):
        A[0, p, p] += 1e-4
    A[0, 2, 2] += variance / prior[1]
    b[2] += variance / prior[1] * (prior[0] - radius)
    inverse = inverses(A)[0]
    moved = np.zeros(3)
    for p in range(3):
        for q in range(3):
            moved[p] += inverse[p, q] * b[q]
            covariance[p, q] = _ALIKE * variance * inverse[p, q]
        covariance[p, p] += 0.001
    return x + moved[0], y + moved[1], min(max(radius + moved[2], 0.3), LARGEST + 1.0)


@compiled
def _find_filled(e: Evidence, top: float, least: float, x: float, y: float, radius: float) -> float:
    """Share of the known cells inside a circle with at least some evidence at its top."""
    high, known = 0, 0
    low, far = find_cell(e, x - radius, y - radius), find_cell(e, x + radius, y + radius)
    for i in range(low[0], far[0] + 1):
        for j in range(low[1], far[1] + 1):
            east, north = (j + 0.5) * e.cell + e.corner[0], (i + 0.5) * e.cell + e.corner[1]
            if (east - x) * (east - x) + (north - y) * (north - y) <= 0.9 * radius * radius:
                level = _level_at(e, top, east, north)
                known += int(not math.isnan(level))
                high += int(level > least)
    return high / known if known > 0 else 0.0


@compiled
def _find_base(e: Evidence, ring: Array, top: float) -> float:
    """Height [m] below which there is no evidence (K,) of a crown's side any more; NaN if it is not seen."""
    most, last = 0.0, 0
    for k in range(1, len(ring)):
        if e.heights[k] <= top and ring[k] > most:
            most, last = ring[k], k
    if last == 0:
        return math.nan
    for k in range(last - 1, 0, -1):
        if not ring[k] >= 0.5 * most:
            share = (0.5 * most - ring[k]) / (ring[k + 1] - ring[k])
            return float(e.heights[k] + share * (e.heights[k + 1] - e.heights[k]))
    return math.nan
