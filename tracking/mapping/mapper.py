"""Map of trees that one UAV makes from the frames of its camera and the poses that it believes."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracking.detection.detector import Frame
from tracking.geometry.visibility import Tree
from tracking.mapping.crowns import LARGEST, Crown, Window, find_crowns, is_same
from tracking.mapping.parallax import FINEST, STEEPEST, Evidence, View, compare, find_cell, view_of
from tracking.numerics.arrays import Array
from tracking.numerics.exponential import exp

UNSEEN, OPEN, COVERED = 0, 1, 2  # states of a cell of the ground
_CELL = 0.25  # m, least edge of a cell of the ground
_APART = 0.045  # of the height above ground, least distance from a frame to the next that is compared
_FAR = 0.4  # of the height above ground, beyond which frames are not compared
_PAUSE = 0.15  # s, least time from a frame to the next that is compared
_SHIFT = 0.8  # pixels between the images of two heights in frames `_APART`, of a camera with `_FOCAL`
_FOCAL = 110.0  # pixels
_TALLEST = 0.6  # of the height above ground, up to which trees are found
_LOWEST = 1.0  # m, below which nothing is a tree
_WIDE = (4.0, 9.0)  # m and m², mean and variance of radii before a crown was seen whole
_TOP = 0.15  # m, standard deviation of the errors of tops of crowns of which a third or more of the rim was seen
_BASE = 0.5  # m, of bases that were seen
_WHOLE = 0.6  # share of the rim of crowns that were seen nearly whole
_MARGIN = 16.0  # m, by which the grid grows at least


@dataclass(frozen=True, eq=False)
class MappedTree:
    """A tree that a UAV believes in.

    Attributes:
        tree: its place and sizes; the trunk's radius is that of any tree.
        covariance: (5, 5) m², of x, y, crown radius, base and top.
        existence: probability that there is such a tree.
        rim: share of its rim that was seen.
    """

    tree: Tree
    covariance: Array
    existence: float
    rim: float


@dataclass(frozen=True, eq=False)
class SeenGround:
    """What was seen of the ground, by cells.

    Attributes:
        corner: east and north [m] of the south-western corner.
        cell: edge of a cell [m].
        states: (rows, columns) from the south and west: 0 not yet seen, 1 open, 2 covered by a mapped crown.
    """

    corner: tuple[float, float]
    cell: float
    states: NDArray[np.uint8]


class TreeMapper(Protocol):
    """Mapper of trees in the frames of one camera; "package.module:Class" names it, which takes no arguments.

    Each UAV has one of its own.
    """

    def add(self, frame: Frame) -> None:
        """Take the next frame of a camera, in order of time."""

    def trees(self) -> tuple[MappedTree, ...]:
        """The trees that are mapped so far."""

    def ground(self) -> SeenGround:
        """What was seen of the ground so far."""


class ParallaxMapper:
    """Mapper by parallax, which needs no model of how trees look, but a camera that moves.

    A crown nearer to the camera moves faster in the image than the ground. Frames some 4 % of the height above ground
    apart are compared, each with the one before and the one after, at one height after the other. The evidence adds up
    on a grid; circles are fitted to it. Their radii are drawn to those of the crowns that were seen whole.
    """

    def __init__(self) -> None:
        self._views: list[tuple[float, Array, View]] = []  # time, position and view of the last frames
        self._evidence: Evidence | None = None
        self._changed: tuple[Array, Array] | None = None  # corners of the ground that changed since the last fit
        self._crowns: list[Crown] = []

    def add(self, frame: Frame) -> None:
        """Take the next frame of the camera; its image is RGB (H, W, 3) or grey (H, W)."""
        position = np.asarray(frame.pose.position, dtype=float)
        height = float(position[2])
        if height <= _LOWEST:
            return
        if self._views:
            time, last, _ = self._views[-1]
            moved = _distance(position, last)
            if moved > _FAR * height or frame.time < time:
                self._views = []
            elif moved < _APART * height or frame.time < time + _PAUSE:
                return
        self._views = [*self._views[-2:], (frame.time, position, view_of(frame))]
        if len(self._views) == 3:
            before, middle, after = (view for _, _, view in self._views)
            self._compare(middle, before, after, frame)

    def _compare(self, middle: View, before: View, after: View, frame: Frame) -> None:
        low, high = _find_reach(frame, middle)
        self._evidence = e = _grow(self._evidence, low, high, frame)
        compare(middle, before, after, e)
        if self._changed is not None:
            low, high = np.minimum(low, self._changed[0]), np.maximum(high, self._changed[1])
        self._changed = low, high

    def trees(self) -> tuple[MappedTree, ...]:
        """The trees that are mapped so far; only where something was seen since the last call are they fitted anew."""
        if self._evidence is not None and self._changed is not None:
            low, high = self._changed[0] - LARGEST, self._changed[1] + LARGEST
            row, column = find_cell(self._evidence, *(low - LARGEST).tolist())
            last_row, last_column = find_cell(self._evidence, *(high + LARGEST).tolist())
            _, rows, columns = self._evidence.counts.shape
            window = Window(max(row, 0), max(column, 0), min(last_row, rows), min(last_column, columns))
            kept = [crown for crown in self._crowns if not _is_within(crown, low, high)]
            found = find_crowns(self._evidence, window, _WIDE) if not self._crowns else self._crowns
            found = find_crowns(self._evidence, window, _learn_radii(found))
            found = [crown for crown in found if _is_within(crown, low, high)]
            self._crowns = [crown for crown in kept if not any(is_same(crown, new) for new in found)] + found
            self._changed = None
        return tuple(_make_tree(crown) for crown in self._crowns)

    def ground(self) -> SeenGround:
        """What was seen of the ground: open where frames show nothing at any height up to the tallest crown.

        What is high, but not a crown yet, counts as not seen.
        """
        e = self._evidence
        if e is None:
            return SeenGround((0.0, 0.0), _CELL, np.zeros((0, 0), dtype=np.uint8))
        trees = [mapped.tree for mapped in self.trees()]
        tallest = max((tree.canopy_top for tree in trees), default=float(e.heights[1]))
        levels = int(np.searchsorted(e.heights, tallest)) + 1
        states = np.where((e.counts[:levels] > 0).all(axis=0) & ~e.high, OPEN, UNSEEN).astype(np.uint8)
        rows, columns = states.shape
        east = e.corner[0] + (np.arange(columns) + 0.5) * e.cell
        north = e.corner[1] + (np.arange(rows) + 0.5) * e.cell
        for tree in trees:
            inside = (
                np.square(east - tree.x) + np.square(north[:, None] - tree.y) <= tree.canopy_radius * tree.canopy_radius
            )
            states[inside] = COVERED
        return SeenGround(e.corner, e.cell, states)


def _distance(one: Array, other: Array) -> float:
    return math.sqrt(math.fsum((a - b) * (a - b) for a, b in zip(one.tolist(), other.tolist(), strict=True)))


def _find_reach(frame: Frame, view: View) -> tuple[Array, Array]:
    """South-western and north-eastern corner (2,) m of the ground that a view may show, level or not."""
    reach = STEEPEST * view.lens.eye[2]
    rays = frame.camera.rays(frame.pose, frame.camera.outline)
    middle = np.array(view.lens.eye[:2])
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.where(rays[:, 2:] < 0.0, rays[:, :2] / -rays[:, 2:] * view.lens.eye[2], math.nan)
    if not np.all(np.abs(ends) < reach):
        return middle - reach, middle + reach
    low, high = np.minimum(ends.min(axis=0), 0.0), np.maximum(ends.max(axis=0), 0.0)
    return middle + low, middle + high


def _grow(evidence: Evidence | None, low: Array, high: Array, frame: Frame) -> Evidence:
    """The evidence on a grid that covers a rectangle, the same one if it does already; the first frame makes it."""
    if evidence is None:
        height, focal = float(frame.pose.position[2]), min(frame.camera.focal * FINEST / max(frame.camera.size), _FOCAL)
        cell = max(_CELL, 1.6 * height / focal)
        south_west, shape = np.floor((low - _MARGIN) / cell), np.ceil((high - low + 2 * _MARGIN) / cell)
        columns, rows = shape.astype(int).tolist()
        heights = _choose_heights(height)
        empty = np.zeros((len(heights), rows, columns), dtype=np.int32)
        east, north = (south_west * cell).tolist()
        return Evidence(empty, empty.copy(), heights, (east, north), cell, np.zeros((rows, columns), dtype=np.bool_))
    _, rows, columns = evidence.counts.shape
    first, last = find_cell(evidence, *low.tolist()), find_cell(evidence, *high.tolist())
    more, margin = math.ceil(_MARGIN / evidence.cell), range(2)
    before = [max(0, more - first[n]) if first[n] < 0 else 0 for n in margin]
    after = [max(0, last[n] + more - size) if last[n] >= size else 0 for n, size in enumerate((rows, columns))]
    if not any(before + after):
        return evidence
    widths = [(0, 0), (before[0], after[0]), (before[1], after[1])]
    corner = evidence.corner[0] - before[1] * evidence.cell, evidence.corner[1] - before[0] * evidence.cell
    return evidence._replace(
        sums=np.pad(evidence.sums, widths),
        counts=np.pad(evidence.counts, widths),
        corner=corner,
        high=np.pad(evidence.high, widths[1:]),
    )


def _choose_heights(altitude: float) -> Array:
    """Heights (K,) m that are compared, the ground's first; between two of them, images shift alike."""
    step = _SHIFT / (_FOCAL * _APART)
    count = int((1.0 / (1.0 - _TALLEST) - 1.0) / step)
    heights = altitude * (1.0 - 1.0 / (1.0 + step * np.arange(1, count + 1)))
    return np.array([0.0, *heights[heights > _LOWEST].tolist()])


def _learn_radii(crowns: list[Crown]) -> tuple[float, float]:
    """Mean [m] and variance of the radii of crowns, from those that were seen nearly whole."""
    radii = [crown.radius for crown in crowns if crown.rim >= _WHOLE]
    if not radii:
        return _WIDE
    mean = math.fsum(radii) / len(radii)
    return mean, (1.0 + math.fsum((radius - mean) * (radius - mean) for radius in radii)) / (len(radii) + 1)


def _is_within(crown: Crown, low: Array, high: Array) -> bool:
    return bool(low[0] <= crown.x <= high[0] and low[1] <= crown.y <= high[1])


def _make_tree(crown: Crown) -> MappedTree:
    """The tree of a crown; a base that was not seen is at half of its height, give or take a quarter."""
    seen = math.isfinite(crown.base)
    base, error = (crown.base, _BASE) if seen else (0.5 * crown.top, 0.25 * crown.top)
    covariance = np.zeros((5, 5))
    covariance[:3, :3] = crown.covariance
    top_error = _TOP / min(1.0, 3.0 * crown.rim) if crown.capped else 0.4 * crown.top
    covariance[3, 3], covariance[4, 4] = error * error, top_error * top_error
    rim = 2.0 * math.pi * crown.radius * crown.rim
    tree = Tree(crown.x, crown.y, crown.radius, base, crown.top)
    return MappedTree(tree, covariance, 1.0 - 0.5 * exp(-0.25 * rim), crown.rim)
