"""The law of sight: the share of a line between two points that vertical cylinders leave free, found by a raster."""

import math
from typing import NamedTuple

import numpy as np

from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.exponential import exp

PIECE = 4.0  # m, horizontal length of a piece of a segment; a steep line of sight rises above the trees within it
_CELL = 2.0  # m, edge of a cell, or more if there would be more than about _CELLS cells
_CELLS = 250_000
_MARGIN = 1e-6  # m: far more than rounding moves a point


class Raster(NamedTuple):
    """Values of the square or oblong cells of a raster; a place outside has the value of the nearest cell."""

    values: Array  # (rows, columns), from south to north and from west to east
    low: tuple[float, float]  # m: the south-west corner
    cell: tuple[float, float]  # m: width and height of a cell

    @classmethod
    def over(cls, area: tuple[float, float], values: Array) -> "Raster":
        """The raster of values over an area of width and height [m] that is centred on the origin."""
        (width, height), (rows, columns) = area, values.shape
        return cls(np.ascontiguousarray(values), (-width / 2, -height / 2), (width / columns, height / rows))


@compiled
def value_at(raster: Raster, x: float, y: float) -> float:
    """Value of a raster at a place [m]."""
    rows, columns = raster.values.shape
    row = min(max(math.floor((y - raster.low[1]) / raster.cell[1]), 0), rows - 1)
    column = min(max(math.floor((x - raster.low[0]) / raster.cell[0]), 0), columns - 1)
    return float(raster.values[row, column])


NOTHING = Raster(np.zeros((1, 1)), (0.0, 0.0), (1.0, 1.0))


class Grid(NamedTuple):
    """Raster over B cylinders with a list of the cylinders near each of its square cells.

    A list holds all cylinders that are at most `PIECE` / 2 from some point of the cell. So if a segment is cut into
    pieces no longer than `PIECE`, it touches only cylinders in the lists of the cells at the middles of the pieces.
    One more list, after those of the cells, holds all cylinders.

    Attributes:
        low: (3,) m: least coordinates of the box round all cylinders.
        high: (3,) m: its greatest coordinates.
        cell: edge of a cell [m].
        rows: number of rows.
        columns: number of columns.
        starts: (rows columns + 2,): where each cell's list begins, row after row.
        members: (M,): indices of cylinders, in each list the widest first, because they hide most.
        unknown: number per m² of trees that no cylinder stands for, around each place.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    cell: float
    rows: int
    columns: int
    starts: Indices
    members: Indices
    unknown: Raster


def make_grid(cylinders: Array, unknown: Raster = NOTHING) -> Grid:
    """Grid over cylinders (B, 5 or more): x, y, radius, bottom, top [m]."""
    every = np.arange(len(cylinders))
    if len(cylinders) == 0:
        return Grid((math.inf,) * 3, (-math.inf,) * 3, _CELL, 1, 1, np.zeros(3, np.int64), every, unknown)
    x, y, radii, bottoms, tops = cylinders[:, :5].T
    low = float(np.min(x - radii)) - _MARGIN, float(np.min(y - radii)) - _MARGIN, float(np.min(bottoms)) - _MARGIN
    high = float(np.max(x + radii)) + _MARGIN, float(np.max(y + radii)) + _MARGIN, float(np.max(tops)) + _MARGIN
    width, height = high[0] - low[0], high[1] - low[1]
    cell = max(_CELL, math.sqrt(width * height / _CELLS), max(width, height) / _CELLS)
    columns, rows = int(width / cell) + 1, int(height / cell) + 1
    centres, reach = np.column_stack([x - low[0], y - low[1]]), radii + PIECE / 2 + 2 * _MARGIN
    index, member = _pair_cells_and_discs(centres, reach, cell, (columns, rows))
    order = np.lexsort((-radii[member], index))
    starts = np.searchsorted(index[order], np.arange(columns * rows + 1))
    members = np.concatenate([member[order], every])
    return Grid(low, high, cell, rows, columns, np.append(starts, len(members)), members, unknown)


def _pair_cells_and_discs(centres: Array, reach: Array, cell: float, shape: tuple[int, int]) -> tuple[Indices, Indices]:
    """All pairs (M,), (M,) of a cell's index and a disc that it touches; discs of radius reach (B,) m."""
    # Take the square of cells around each disc, and keep the cells that the disc touches.
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


Vector = Array | tuple[float, ...]  # in compiled loops tuples take half the time of rows of an array


@compiled
def is_blocked(origin: Vector, point: Vector, cylinder: Vector) -> bool:
    """Test if the segment from origin (3,) to point (3,) touches the solid cylinder (5,)."""
    dx, dy, dz = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    ox, oy = origin[0] - cylinder[0], origin[1] - cylinder[1]
    length = dx * dx + dy * dy
    across = ox * dy - oy * dx
    if across * across > cylinder[2] * cylinder[2] * length:
        return False  # the whole line is too far from the axis, as in most cases; this test needs no division
    start, end = 0.0, 1.0
    if dz == 0.0:
        if origin[2] < cylinder[3] or origin[2] > cylinder[4]:
            return False
    else:
        a, b = (cylinder[3] - origin[2]) / dz, (cylinder[4] - origin[2]) / dz
        start, end = max(start, min(a, b)), min(end, max(a, b))
        if start > end:
            return False
    # Take the point o + s d of the remaining piece that is nearest to the axis, and test |o + s d|² <= r².
    s = start if length == 0.0 else min(max(-(ox * dx + oy * dy) / length, start), end)
    x, y = ox + s * dx, oy + s * dy
    return bool(x * x + y * y <= cylinder[2] * cylinder[2])


@inlined
def length_inside(origin: Vector, point: Vector, cylinder: Vector, start: float, end: float) -> float:
    """Length [m] inside a solid cylinder of a part of a segment that touches the cylinder.

    The part of the segment from origin (3,) to point (3,) m is from `start`, 0 at the origin, to `end`, 1 at the point.
    cylinder (5 or more,) as in `make_grid`.
    """
    dx, dy, dz = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    ox, oy = origin[0] - cylinder[0], origin[1] - cylinder[1]
    length = dx * dx + dy * dy
    if length > 0.0:
        across, along = ox * dy - oy * dx, ox * dx + oy * dy
        half = math.sqrt(max(cylinder[2] * cylinder[2] * length - across * across, 0.0))
        start, end = max(start, (-along - half) / length), min(end, (half - along) / length)
    if dz != 0.0:
        a, b = (cylinder[3] - origin[2]) / dz, (cylinder[4] - origin[2]) / dz
        start, end = max(start, min(a, b)), min(end, max(a, b))
    return max(end - start, 0.0) * math.sqrt(length + dz * dz)


@inlined
def optical_depth(origin: Vector, point: Vector, cylinder: Vector, start: float, end: float) -> float:
    """Extinction times length of a part of a segment inside a cylinder, by which `free_share` falls.

    It is 0 outside, and infinite if the segment touches an opaque cylinder.
    Arguments as of `length_inside`; the last entry of the cylinder (6,) is the extinction [1/m].
    """
    if not is_blocked(origin, point, cylinder):
        return 0.0
    return math.inf if cylinder[5] == math.inf else cylinder[5] * length_inside(origin, point, cylinder, start, end)


@inlined
def free_share(origin: Vector, point: Vector, cylinders: Array, grid: Grid, leaves: bool = False) -> float:
    """Probability that nothing in cylinders (B, 6 or 7) is on the segment from origin (3,) to point (3,).

    The last column is the extinction [1/m]. It is infinite for opaque cylinders, which leave nothing free. Porous ones
    leave exp(-extinction s) of a path of s m, the law of Beer and Lambert.
    Source: [Monsi53], for leaves in random places.

    leaves: True to leave out the opaque cylinders.
    """
    start, end = clip(origin, point, grid.low, grid.high)
    if start > end:
        return 1.0
    dx, dy = point[0] - origin[0], point[1] - origin[1]
    length = (end - start) * math.sqrt(dx * dx + dy * dy)
    every = not length <= PIECE * len(cylinders)  # more pieces than cylinders, or not a number
    pieces = 1 if every else int(length / PIECE) + 1
    depth = 0.0  # extinction times length, of each cylinder piece by piece
    for k in range(pieces):
        s = start + (end - start) * (k + 0.5) / pieces
        cell = grid.rows * grid.columns if every else find_cell(origin[0] + s * dx, origin[1] + s * dy, grid)
        low, high = start + (end - start) * k / pieces, start + (end - start) * (k + 1) / pieces
        for m in range(grid.starts[cell], grid.starts[cell + 1]):
            if leaves and cylinders[grid.members[m], 5] == math.inf:
                continue
            depth += optical_depth(origin, point, cylinder_of(cylinders, grid.members[m]), low, high)
            if depth == math.inf:
                return 0.0
    return exp(-depth) if depth > 0.0 else 1.0


@inlined
def cylinder_of(cylinders: Array, row: int) -> Vector:
    """A row of cylinders (B, 6)."""
    c = cylinders
    return c[row, 0], c[row, 1], c[row, 2], c[row, 3], c[row, 4], c[row, 5]


@compiled
def find_cell(x: float, y: float, grid: Grid) -> int:
    """Index of the cell at a place, or of the nearest cell."""
    row = min(max(int((y - grid.low[1]) / grid.cell), 0), grid.rows - 1)
    column = min(max(int((x - grid.low[0]) / grid.cell), 0), grid.columns - 1)
    return row * grid.columns + column


@inlined
def clip(origin: Vector, point: Vector, low: Vector, high: Vector) -> tuple[float, float]:
    """Part [start, end] in a box of the segment from origin (3,), at 0, to point (3,), at 1; start > end if none."""
    start, end = 0.0, 1.0
    for axis in range(3):
        o, p, below, above = origin[axis], point[axis], low[axis], high[axis]
        if (o < below and p < below) or (o > above and p > above):
            return 1.0, 0.0
        if o < below or p < below or o > above or p > above:
            a, b = (below - o) / (p - o), (above - o) / (p - o)
            start, end = max(start, min(a, b)), min(end, max(a, b))
    return start, end
