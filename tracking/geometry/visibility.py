"""Occlusion by trees: exact line of sight, the paper's discs, and the probability of detection."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tracking.geometry.camera import Camera, Lens, Pose, in_image
from tracking.geometry.tree_grid import PIECE, Grid, gridded
from tracking.numerics.compiled import Array, compiled
from tracking.numerics.elementary import exp_each
from tracking.numerics.matrices import cholesky
from tracking.numerics.normal import normal_quantile_each

# Half of a walking person's 1.7 m: the point that stands for a person wherever one point must.
TARGET_HEIGHT = 0.85

Occlusion = Literal["line_of_sight", "disc"]
Vector = Array | tuple[float, ...]  # in compiled loops tuples take half the time of rows of an array


@dataclass(frozen=True)
class Tree:
    """A trunk from the ground to the canopy's base and a canopy, both vertical cylinders [m]."""

    x: float
    y: float
    canopy_radius: float = 5.0
    canopy_base: float = 3.0
    canopy_top: float = 6.0
    trunk_radius: float = 0.2


@dataclass(frozen=True, eq=False)
class Forest:
    """The known map of trees and how they hide what stands among them."""

    trees: tuple[Tree, ...]
    occlusion: Occlusion = "line_of_sight"

    @cached_property
    def cylinders(self) -> Array:
        """All trunks and canopies (2 T, 5): x, y, radius, bottom, top [m]."""
        rows = [(t.x, t.y, t.trunk_radius, 0.0, t.canopy_base) for t in self.trees]
        rows += [(t.x, t.y, t.canopy_radius, t.canopy_base, t.canopy_top) for t in self.trees]
        return np.array(rows, dtype=float).reshape(-1, 5)

    @cached_property
    def blockers(self) -> Array:
        """What `blocked` takes (B, 5): the cylinders, or, for discs, a column over each canopy.

        Note: [Li22] hides a target whenever it is inside a circle. Its disc is a column without trunk whose top and
        bottom are at the target's height, where every line of sight ends.
        """
        if self.occlusion == "line_of_sight":
            return self.cylinders
        rows = [(t.x, t.y, t.canopy_radius, TARGET_HEIGHT, TARGET_HEIGHT) for t in self.trees]
        return np.array(rows, dtype=float).reshape(-1, 5)

    @cached_property
    def grid(self) -> Grid:
        """Which `blockers` are near a place."""
        return gridded(self.blockers)

    def visible(self, cameras: Array, points: Array) -> NDArray[np.bool_]:
        """Whether each camera (C, 3) m has a free line to each point (N, 3) m, field of view aside (C, N)."""
        return line_of_sight(cameras, points, self)

    def hiding(self, camera: Array, points: Array) -> NDArray[np.bool_]:
        """Which trees stand between a camera (3,) m and each point (N, 3) m (N, T)."""
        origin, ends = (np.ascontiguousarray(x, dtype=float) for x in (camera, np.atleast_2d(points)))
        touched = _touched(origin, ends, self.blockers)
        parts = len(self.blockers) // max(len(self.trees), 1)  # of a tree
        return np.asarray(touched.reshape(len(ends), parts, len(self.trees)).any(axis=1), dtype=np.bool_)


@compiled
def blocked(origin: Vector, point: Vector, cylinder: Vector) -> bool:
    """Whether the segment from origin (3,) to point (3,) touches the solid cylinder (5,)."""
    dx, dy, dz = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    ox, oy = origin[0] - cylinder[0], origin[1] - cylinder[1]
    length = dx * dx + dy * dy
    across = ox * dy - oy * dx
    if across * across > cylinder[2] * cylinder[2] * length:
        return False  # the whole line passes the axis too far off: settles most cases without a division
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


def line_of_sight(cameras: Array, points: Array, forest: Forest) -> NDArray[np.bool_]:
    """Whether each camera (C, 3) m has a free line to each point (N, 3) m, field of view aside (C, N).

    Whatever the heights of cameras and points, the answer is that of testing every tree.
    """
    origins, ends = (np.ascontiguousarray(np.atleast_2d(x), dtype=float) for x in (cameras, points))
    return _free(origins, ends, forest.blockers, forest.grid)


@compiled
def _free(cameras: Array, points: Array, cylinders: Array, grid: Grid) -> NDArray[np.bool_]:
    """Whether the segments from cameras (C, 3) to points (N, 3) miss all cylinders (B, 5); (C, N)."""
    free = np.empty((len(cameras), len(points)), dtype=np.bool_)
    for i in range(len(cameras)):
        camera = cameras[i, 0], cameras[i, 1], cameras[i, 2]
        for j in range(len(points)):
            point = points[j, 0], points[j, 1], points[j, 2]
            free[i, j] = misses(camera, point, cylinders, grid)
    return free


@compiled
def _touched(camera: Array, points: Array, cylinders: Array) -> NDArray[np.bool_]:
    """Which cylinders (B, 5) the segments from a camera (3,) to points (N, 3) touch (N, B)."""
    touched = np.empty((len(points), len(cylinders)), dtype=np.bool_)
    for j in range(len(points)):
        for b in range(len(cylinders)):
            touched[j, b] = blocked(camera, points[j], cylinders[b])
    return touched


@compiled
def misses(origin: Vector, point: Vector, cylinders: Array, grid: Grid) -> bool:
    """Whether the segment from origin (3,) to point (3,) misses all cylinders (B, 5)."""
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


def _centroids(count: int) -> Array:
    """Means of `count` equally probable parts of a standard normal distribution (count,)."""
    edges = normal_quantile_each(np.arange(1, count) / count)
    density = np.concatenate([[0.0], exp_each(-0.5 * edges * edges) / math.sqrt(2 * math.pi), [0.0]])
    return np.asarray(count * (density[:-1] - density[1:]))


# Equally probable points that stand for a standard normal distribution of the plane (36, 2), and the variance along
# each axis of the part that each stands for. What is averaged jumps from 0 to 1, where rules for smooth functions
# fail: three Gauss-Hermite points per axis give 1/6 or 5/6 at an edge through the mean. With an even number per axis
# no point lies on such an edge, and the moments of either side are exact.
SAMPLES = np.array([(a, b) for a in _centroids(6) for b in _centroids(6)])
SAMPLE_VARIANCE = float(1.0 - np.mean(np.square(_centroids(6))))


def visible_samples(camera: Camera, pose: Pose, means: Array, covariances: Array, forest: Forest) -> NDArray[np.bool_]:
    """Which of the points that stand for each Gaussian are inside the image and not hidden (N, 36).

    means (N, 2) m, covariances (N, 2, 2) m²; the points are mean + L `SAMPLES`, with L Lᵀ the covariance.
    """
    roots = cholesky(covariances)
    return _seen(means, roots, camera.lens(pose), forest.blockers, forest.grid)


@compiled
def _seen(means: Array, roots: Array, lens: Lens, cylinders: Array, grid: Grid) -> NDArray[np.bool_]:
    """Which of the points mean + root `SAMPLES` are inside the image and not hidden (N, 36)."""
    origin = lens[0][0], lens[0][1], lens[0][2]
    seen = np.empty((len(means), len(SAMPLES)), dtype=np.bool_)
    for i in range(len(means)):
        for k in range(len(SAMPLES)):
            x = means[i, 0] + roots[i, 0, 0] * SAMPLES[k, 0]
            y = means[i, 1] + (roots[i, 1, 0] * SAMPLES[k, 0] + roots[i, 1, 1] * SAMPLES[k, 1])
            seen[i, k] = in_image((x, y, TARGET_HEIGHT), lens) and misses(
                origin, (x, y, TARGET_HEIGHT), cylinders, grid
            )
    return seen


def probability_of_detection(camera: Camera, pose: Pose, means: Array, covariances: Array, forest: Forest) -> Array:
    """Probability (N,) that people with Gaussian positions are inside the image and not hidden.

    means (N, 2) m, covariances (N, 2, 2) m². The expectation over each belief is taken at 6 x 6 points.
    """
    return np.asarray(visible_samples(camera, pose, means, covariances, forest).mean(axis=1))
