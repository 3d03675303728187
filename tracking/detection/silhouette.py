"""A walking person's mean silhouette on the plane at people's mid-height, and its part outside shadows."""

import math
from typing import NamedTuple

import numpy as np

from tracking.detection.clearing import Clearing
from tracking.detection.shadows import find_openings, intersect_row
from tracking.geometry.person import SILHOUETTE, TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.trigonometry import hypot

TALLEST = SILHOUETTE[-1][0]  # m
_ROWS = 6  # rows on either side of the middle
_BINS = 48


class Silhouette(NamedTuple):
    """Area of the plane that a person covers, in (u, v) m from the person's mid-height; symmetric about v = 0."""

    low: float  # least u, m
    high: float  # greatest u, m
    half: float  # greatest v, m
    bin: float  # m
    row: float  # width of a row, m; the k-th is at v = (k + 1/2) row
    cover: Array  # (_ROWS, _BINS + 1) m, integrals of the cover over u, from `low` to each edge of a bin
    moment: Array  # (_ROWS, _BINS + 1) m², the same integrals of u times the cover
    middle: float  # u of the centroid, m
    area: float  # m²


@compiled
def make_silhouette(distance: float, altitude: float) -> Silhouette:
    """Silhouette of a person `distance` m away, horizontally, from a camera `altitude` m above ground."""
    circles, low, high, half = np.empty((len(SILHOUETTE), 3)), math.inf, -math.inf, 0.0
    for k, (h, radius, share) in enumerate(SILHOUETTE):
        growth = (altitude - TARGET_HEIGHT) / (altitude - h)
        u, r = distance * (growth - 1.0), radius * growth
        low, high, half = min(low, u - r), max(high, u + r), max(half, r)
        circles[k, 0], circles[k, 1], circles[k, 2] = u, r, share
    step, row = (high - low) / _BINS, half / _ROWS
    cover, moment = np.zeros((_ROWS, _BINS + 1)), np.zeros((_ROWS, _BINS + 1))
    area = middle = 0.0
    for i in range(_ROWS):
        line = _cover_row((i + 0.5) * row, circles, low, step)
        for j in range(_BINS):
            cover[i, j + 1] = cover[i, j] + line[j] * step
            moment[i, j + 1] = moment[i, j] + line[j] * step * (low + (j + 0.5) * step)
        area += 2 * row * cover[i, _BINS]
        middle += 2 * row * moment[i, _BINS]
    return Silhouette(low, high, half, step, row, cover, moment, middle / area, area)


@compiled
def _cover_row(v: float, circles: Array, low: float, step: float) -> Array:
    """Share of each bin (_BINS,) that a row of the silhouette covers.

    circles (8, 3): u and radius of the levels, m, and their share of headings. The first bin starts at `low` m, and
    each is `step` m wide.
    """
    line = np.zeros(_BINS)
    for k in range(1, len(circles)):
        start, end = intersect_row((circles[k - 1, 0], 0.0, circles[k - 1, 1], circles[k, 0], 0.0, circles[k, 1]), v)
        for j in range(_BINS):
            inside = min(end, low + (j + 1) * step) - max(start, low + j * step)
            if inside > 0.0:  # higher parts are nearer to the camera
                line[j] += (circles[k, 2] - line[j]) * inside / step
    return line


@compiled
def compute_visible_moments(clearing: Clearing, silhouette: Silhouette, u: Array, v: Array) -> Array:
    """Visible area m² and its moments m³ (M, N, 3) of people at each pair of u (N,) and v (M,) m.

    The moments are those of the coordinates relative to the person.
    """
    out, c = np.zeros((len(v), len(u), 3)), clearing
    for i in range(len(v)):
        first = 0
        while first < len(u):  # at once for people behind the same trunks: a trunk hides none in front of it
            near = c.shadows[:, 6] <= hypot(c.distance + u[first], v[i])
            around = Clearing(c.origin, c.away, c.distance, c.edges, c.footprint, c.shadows[near])
            last = first + 1
            while last < len(u) and np.all((c.shadows[:, 6] <= hypot(c.distance + u[last], v[i])) == near):
                last += 1
            _add_visible_moments(around, silhouette, u[first:last], v[i], out[i, first:last])
            first = last
    return out


@compiled
def _add_visible_moments(clearing: Clearing, silhouette: Silhouette, u: Array, v: float, out: Array) -> None:
    """Add the visible part of people at u (N,) m of the row at v m to areas and moments (N, 3)."""
    intervals = np.empty((len(clearing.shadows) + 1, 2))
    for k in range(-_ROWS, _ROWS):
        rise = (k + 0.5) * silhouette.row
        row = k if k >= 0 else -1 - k
        cover, moment = silhouette.cover[row], silhouette.moment[row]
        for m in range(find_openings(clearing, v + rise, intervals)):
            for j in range(len(u)):
                start = _count_bins(intervals[m, 0] - u[j], silhouette)
                end = _count_bins(intervals[m, 1] - u[j], silhouette)
                if end > start:
                    area = silhouette.row * (_interpolate(cover, end) - _interpolate(cover, start))
                    out[j, 0] += area
                    out[j, 1] += silhouette.row * (_interpolate(moment, end) - _interpolate(moment, start))
                    out[j, 2] += area * rise


@compiled
def _count_bins(u: float, silhouette: Silhouette) -> float:
    return min(max((u - silhouette.low) / silhouette.bin, 0.0), float(_BINS))


@compiled
def _interpolate(values: Array, at: float) -> float:
    """Value at a fractional index of values (_BINS + 1,), by linear interpolation."""
    k = min(int(at), _BINS - 1)
    return float(values[k] + (at - k) * (values[k + 1] - values[k]))
