"""Raster over vertical cylinders, so that a line of sight is tested only against those near it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tracking.numerics.arrays import Array, Indices

PIECE = 4.0  # m, horizontally: a steep line of sight from above leaves the height of the trees within this
_CELL = 2.0  # m, unless there were more than about _CELLS of them
_CELLS = 250_000
_MARGIN = 1e-6  # m: far more than rounding moves a point


class Grid(NamedTuple):
    """Raster over B cylinders with a list of those near each of its square cells.

    A list holds all cylinders that are at most `PIECE` / 2 from some point of the cell. So if a segment
    is cut into pieces no longer than `PIECE`, it touches only cylinders listed in the cells of their middles.
    One more list, after those of the cells, holds all cylinders.
    """

    low: tuple[float, float, float]  # m: corner of the box round all cylinders
    high: tuple[float, float, float]  # m
    cell: float  # m
    rows: int
    columns: int
    starts: Indices  # (rows columns + 2,): where each cell's list begins, row after row
    members: Indices  # (M,): indices of cylinders, in each list the widest first, because they hide most


def gridded(cylinders: Array) -> Grid:
    """Grid over cylinders (B, 5): x, y, radius, bottom, top [m]."""
    every = np.arange(len(cylinders))
    if len(cylinders) == 0:
        return Grid((math.inf,) * 3, (-math.inf,) * 3, _CELL, 1, 1, np.zeros(3, np.int64), every)
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
    members = np.concatenate([member[order], every])
    return Grid(low, high, cell, rows, columns, np.append(starts, len(members)), members)


def _pairs(centres: Array, reach: Array, cell: float, shape: tuple[int, int]) -> tuple[Indices, Indices]:
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
