"""A raster over vertical cylinders, so that a line of sight is tested against the few that are near it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracking.numerics.compiled import Array

PIECE = 4.0  # m, horizontally; seen from above, a line of sight leaves the height of the trees within this
_CELL = 2.0  # m, unless there were more than about _CELLS of them
_CELLS = 250_000
_MARGIN = 1e-6  # m: far more than rounding moves a point


class Grid(NamedTuple):
    """Which of B cylinders are near a place: a raster over all of them, with a list for each of its square cells.

    A list holds all cylinders that are at most `PIECE` / 2 from some point of the cell. So a segment touches only
    what is listed in the cells in which the middles of its pieces fall, if no piece is longer than `PIECE`.
    One more list, after those of the cells, holds every cylinder.
    """

    low: tuple[float, float, float]  # m: corner of the box round all cylinders
    high: tuple[float, float, float]  # m
    cell: float  # m
    rows: int
    columns: int
    starts: NDArray[np.int64]  # (rows columns + 2,): where each cell's list begins, row after row
    members: NDArray[np.int64]  # (M,): indices of cylinders, in each list the widest first, because they hide most


def gridded(cylinders: Array) -> Grid:
    """The grid of cylinders (B, 5): x, y, radius, bottom, top [m]."""
    everyone = np.arange(len(cylinders))
    if len(cylinders) == 0:
        return Grid((math.inf,) * 3, (-math.inf,) * 3, _CELL, 1, 1, np.zeros(3, np.int64), everyone)
    x, y, radii, bottoms, tops = cylinders.T
    low = float(np.min(x - radii)) - _MARGIN, float(np.min(y - radii)) - _MARGIN, float(np.min(bottoms)) - _MARGIN
    high = float(np.max(x + radii)) + _MARGIN, float(np.max(y + radii)) + _MARGIN, float(np.max(tops)) + _MARGIN
    width, height = high[0] - low[0], high[1] - low[1]
    cell = max(_CELL, math.sqrt(width * height / _CELLS), max(width, height) / _CELLS)
    columns, rows = int(width / cell) + 1, int(height / cell) + 1
    centres, reach = np.column_stack([x - low[0], y - low[1]]), radii + PIECE / 2 + 2 * _MARGIN
    index, member = _pairs(centres, reach, cell, (columns, rows))
    order = np.lexsort((-radii[member], index))
    starts = np.searchsorted(index[order], np.arange(columns * rows + 1))
    members = np.concatenate([member[order], everyone])
    return Grid(low, high, cell, rows, columns, np.append(starts, len(members)), members)


def _pairs(
    centres: Array, reach: Array, cell: float, shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All pairs (M,), (M,) of a cell's index and a disc that it touches; discs of radius reach (B,) m."""
    # The square of cells round each disc, and of them those that the disc touches.
    first = np.maximum((centres - reach[:, None]) // cell, 0).astype(np.int64)
    last = np.minimum((centres + reach[:, None]) // cell, np.array(shape) - 1).astype(np.int64)
    size = last - first + 1
    count = size[:, 0] * size[:, 1]
    disc = np.repeat(np.arange(len(centres)), count)
    rank = np.arange(len(disc)) - np.repeat(np.cumsum(count) - count, count)
    at = first[disc] + np.column_stack([rank % size[disc, 0], rank // size[disc, 0]])
    gap = np.maximum(np.abs(centres[disc] - cell * (at + 0.5)) - cell / 2, 0.0)
    near = np.sum(np.square(gap), axis=1) <= np.square(reach[disc])
    return (at[:, 1] * shape[0] + at[:, 0])[near], disc[near]
