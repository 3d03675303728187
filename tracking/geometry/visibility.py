"""Visibility of people among trees: the map of trees, lines of sight, and probabilities of detection."""

import math
from dataclasses import astuple, dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from tracking.geometry.leaf_gaps import USUAL_PIXEL, USUAL_SLOPE, detectability, detectable_share
from tracking.geometry.lens import Lens, image_point, in_image, lens_of, pixel_size
from tracking.geometry.line_of_sight import NOTHING, Grid, Raster, cylinder_of, free_share, make_grid, optical_depth
from tracking.geometry.map_errors import DEVIATION, REACH
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.unseen_ground import average_within
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp, exp_each
from tracking.numerics.normal import normal_quantiles
from tracking.numerics.stacks import cholesky_factors, elementwise

# Area of leaves in random directions as seen along a line, as a share of their true area. Source: [Monsi53].
EXTINCTION = 0.5


def at_target_height(places: Array) -> Array:
    """Points (N, 3) m at `TARGET_HEIGHT` over places (N, 2) m."""
    points = np.empty((len(places), 3))
    points[:, :2], points[:, 2] = places, TARGET_HEIGHT
    return points


Occlusion = Literal["line_of_sight", "disc"]
Part = Literal["trunk", "canopy"]
PARTS: tuple[Part, ...] = ("trunk", "canopy")  # in the order of `Forest.solids`


class Solid(NamedTuple):
    """A part of a tree: a vertical cylinder, full of leaves or opaque."""

    part: Part
    x: float  # m
    y: float  # m
    radius: float  # m
    bottom: float  # m
    top: float  # m
    leaf_area_density: float = math.inf  # m²/m³; infinite if opaque

    @property
    def extinction(self) -> float:
        """Extinction [1/m] of lines of sight inside; infinite if opaque."""
        return EXTINCTION * self.leaf_area_density

    @property
    def cover(self) -> float:
        """Share of the ground below that it hides from straight above."""
        return 1.0 - exp(-self.extinction * (self.top - self.bottom)) if self.is_porous else 1.0

    @property
    def is_porous(self) -> bool:
        """True if lines of sight pass in part."""
        return math.isfinite(self.leaf_area_density)


@dataclass(frozen=True)
class Tree:
    """A trunk from the ground to the canopy's base and a canopy, both vertical cylinders [m]; trunks are opaque."""

    x: float
    y: float
    canopy_radius: float = 5.0
    canopy_base: float = 3.0
    canopy_top: float = 6.0
    trunk_radius: float = 0.2
    leaf_area_density: float = math.inf  # m²/m³, leaf area in the canopy's volume; infinite if the canopy is opaque

    @property
    def solids(self) -> tuple[Solid, ...]:
        """The parts that hide people, from the ground up. Only this property knows the shape of a tree."""
        x, y, base = self.x, self.y, self.canopy_base
        trunk = Solid("trunk", x, y, self.trunk_radius, 0.0, base)
        return trunk, Solid("canopy", x, y, self.canopy_radius, base, self.canopy_top, self.leaf_area_density)


class Occluders(NamedTuple):
    """What hides people, for compiled code."""

    cylinders: Array  # (B, 6 or 7)
    grid: Grid


@dataclass(frozen=True, eq=False)
class Forest:
    """A map of trees, true or as a UAV believes it at a time, and the model of their occlusion.

    Attributes:
        trees: the trees.
        occlusion: `line_of_sight`, or `disc` as in the paper.
        deviation: standard deviation [m] of the errors of the trees' places along each axis, one of all or one of each
            tree, by which probabilities of detection allow for errors of opaque trees. Other methods take trees to be
            where the map has them.
        unknown: number per m² of opaque trees that the map lacks, for which they allow as well: everywhere, or of the
            cells of a raster, such as those not yet seen (`tracking.geometry.unseen_ground`).
        unknown_tree: the size of unknown trees, wherever it stands; None: the mean one of `trees`.
    """

    trees: tuple[Tree, ...]
    occlusion: Occlusion = "line_of_sight"
    deviation: float | tuple[float, ...] = 0.0
    unknown: float | Raster = 0.0
    unknown_tree: Tree | None = None

    @cached_property
    def lacks_trees(self) -> bool:
        """True if trees of some size may be unknown."""
        number = self.unknown.values if isinstance(self.unknown, Raster) else self.unknown
        return bool(np.any(number)) and bool(self.trees or self.unknown_tree)

    @cached_property
    def errs(self) -> bool:
        """True if trees may be elsewhere, or unknown."""
        return bool(np.any(self.deviation)) or self.lacks_trees

    @cached_property
    def as_mapped(self) -> "Forest":
        """The same trees where the map has them, as detectors locate people with them."""
        return Forest(self.trees) if self.errs or self.occlusion != "line_of_sight" else self

    @cached_property
    def is_porous(self) -> bool:
        """True if any solid is porous."""
        return any(solid.is_porous for solid in self.solids)

    @property
    def table(self) -> Array:
        """The fields of each `Tree` (T, 7), or (T, 6) if all are opaque."""
        rows = np.array([astuple(tree) for tree in self.trees], dtype=float).reshape(-1, 7)
        return rows if self.is_porous else rows[:, :6]

    @cached_property
    def solids(self) -> tuple[Solid, ...]:
        """The parts of all trees: for each of `PARTS` in turn, those of each tree."""
        return tuple(solid for part in PARTS for tree in self.trees for solid in tree.solids if solid.part == part)

    @cached_property
    def tree_of_solids(self) -> Indices:
        """Index (B,) of the tree that each of the `solids` is a part of."""
        parts = [(PARTS.index(solid.part), k) for k, tree in enumerate(self.trees) for solid in tree.solids]
        return np.array([k for _, k in sorted(parts)], dtype=np.int64)

    @cached_property
    def cylinders(self) -> Array:
        """All `solids` (B, 6): x, y, radius, bottom, top [m], extinction [1/m], infinite if opaque."""
        return np.array([(*s[1:6], s.extinction) for s in self.solids], dtype=float).reshape(-1, 6)

    @cached_property
    def blockers(self) -> Array:
        """Cylinders (B, 6 or 7) on lines of sight: all solids, or with "disc" one opaque disc for each canopy.

        Note: [Li22] hides a target whenever it is inside a circle. A disc is a cylinder whose top and bottom are both
        at the target's height, where every line of sight ends. With a `deviation`, that is a seventh column (B, 7),
        and with `unknown` trees these are one more row, as in `tracking.geometry.map_errors`. A raster of them is part
        of the `grid`.
        """
        found = self.cylinders
        if self.occlusion == "disc":
            found = self.canopies.copy()
            found[:, 3:5] = TARGET_HEIGHT
            found[:, 5] = math.inf
        if not self.errs:
            return found
        deviations = np.broadcast_to(self.deviation, len(self.trees))[self.tree_of_blockers]
        found = np.column_stack([found, deviations])
        if not self.lacks_trees:
            return found
        mean = Forest((self.unknown_tree,)) if self.unknown_tree else self
        _, _, radius, low, high, *_ = mean.canopies.mean(axis=0)
        sizes = (radius, low, high) if self.occlusion == "line_of_sight" else (radius, TARGET_HEIGHT, TARGET_HEIGHT)
        everywhere = 0.0 if isinstance(self.unknown, Raster) else self.unknown
        return np.vstack([found, (everywhere, 0.0, *sizes, math.inf, math.inf)])

    @cached_property
    def reach(self) -> Array:
        """Distance (B,) m from the axis of each of the `blockers` within which it may hide people."""
        if not self.errs:
            return self.blockers[:, 2]
        return np.asarray(self.blockers[:, 2] + REACH * self.blockers[:, DEVIATION])

    @cached_property
    def canopies(self) -> Array:
        """The canopies (T, 6), as in `cylinders`."""
        return self.cylinders[[solid.part == "canopy" for solid in self.solids]].reshape(-1, 6)

    @cached_property
    def tree_of_blockers(self) -> Indices:
        """Index (B,) of the tree that each of the `blockers` is a part of."""
        return self.tree_of_solids if self.occlusion == "line_of_sight" else np.arange(len(self.trees))

    @cached_property
    def from_west(self) -> Indices:
        """Indices (B,) of the `blockers` from west to east."""
        return np.argsort(self.blockers[:, 0], kind="stable")

    @cached_property
    def occluders(self) -> Occluders:
        """The `blockers` with their `grid`, for compiled code."""
        return Occluders(self.blockers, self.grid)

    @cached_property
    def grid(self) -> Grid:
        """Grid over the `blockers`."""
        within = self.blockers.copy()
        within[:, 2] = self.reach
        return make_grid(within[np.isfinite(self.reach)], self.unknown_around)

    @cached_property
    def unknown_around(self) -> Raster:
        """Number per m² of unknown trees by which each place may be hidden."""
        if isinstance(self.unknown, Raster) and self.lacks_trees:
            return average_within(self.unknown, float(self.blockers[-1, 2]))
        return NOTHING if isinstance(self.unknown, Raster) else NOTHING._replace(values=np.full((1, 1), self.unknown))

    def visible(self, cameras: Array, points: Array) -> Flags:
        """Flags (C, N) of points (N, 3) m where cameras (C, 3) m see a person in view with probability 1/2 or more.

        Without porous trees, these are the unobstructed lines. Else cameras are taken to have the usual pixels.
        """
        return detectable_shares(self.free_shares(cameras, points)) >= 0.5

    def free_shares(self, cameras: Array, points: Array) -> Array:
        """Free shares (C, N) of lines from cameras (C, 3) m to points (N, 3) m, in or out of the field of view.

        The result is the same as if every tree were tested, for cameras and points at any height.
        """
        origins, ends = (np.ascontiguousarray(np.atleast_2d(x), dtype=float) for x in (cameras, points))
        return _find_free_shares(origins, ends, self.blockers, self.grid)

    def detectabilities(self, lens: Lens, points: Array) -> Array:
        """Probabilities (N,) that enough of people at points (N, 3) m shows to a camera to detect them.

        Points in or out of the image are the same; see `tracking.geometry.leaf_gaps.detectability`.
        """
        return _find_detectabilities(lens, np.ascontiguousarray(points, dtype=float), self.blockers, self.grid)

    def find_shown(self, optics: Array, positions: Array, quaternions: Array, points: Array) -> Array:
        """Probabilities (C, N) that cameras detect people at points (N, 3) m: `detectabilities`, 0 out of the image.

        optics (C, 16): `Optics.numbers` of each camera; positions (C, 3) m and quaternions (C, 4): their poses. Nobody
        is at points that are NaN.
        """
        return _find_shown(optics, positions, quaternions, points, self.blockers, self.grid)

    def detectabilities_through_leaves(self, lens: Lens, points: Array) -> Array:
        """`detectabilities` (N,) if there were only the porous solids."""
        if len(self.leaves.cylinders) == 0:
            return np.ones(len(points))
        return _find_detectabilities(lens, np.ascontiguousarray(points, dtype=float), *self.leaves)

    @cached_property
    def leaves(self) -> Occluders:
        """The porous `blockers` (B, 6 or 7), and a grid over them."""
        porous = self.blockers[np.isfinite(self.blockers[:, 5])]
        return Occluders(porous, make_grid(porous))

    def shares_hidden(self, camera: Array, points: Array) -> Array:
        """Share (N, T) of each line from a camera (3,) m to points (N, 3) m that each tree hides by itself."""
        tree_of = self.tree_of_blockers
        return _find_shares_hidden(camera, points, self.blockers[: len(tree_of)], tree_of, len(self.trees))


NO_TREES = Forest(())


@compiled
def _find_free_shares(cameras: Array, points: Array, cylinders: Array, grid: Grid) -> Array:
    """Free shares (C, N) of segments from cameras (C, 3) to points (N, 3) among cylinders (B, 6 or 7)."""
    free = np.empty((len(cameras), len(points)))
    for i in range(len(cameras)):
        camera = cameras[i, 0], cameras[i, 1], cameras[i, 2]
        for j in range(len(points)):
            point = points[j, 0], points[j, 1], points[j, 2]
            free[i, j] = free_share(camera, point, cylinders, grid)
    return free


@compiled
def _find_detectabilities(lens: Lens, points: Array, cylinders: Array, grid: Grid) -> Array:
    """Probabilities (N,) that people at points (N, 3) among cylinders (B, 6 or 7) show, in or out of the image."""
    out = np.empty(len(points))
    for j in range(len(points)):
        point = points[j, 0], points[j, 1], points[j, 2]
        out[j] = detectability(lens.eye, point, pixel_size(lens, point), cylinders, grid)
    return out


@compiled
def _find_shown(
    optics: Array, positions: Array, quaternions: Array, points: Array, cylinders: Array, grid: Grid
) -> Array:
    """Probabilities (C, N) that C cameras detect people at points (N, 3) among cylinders (B, 6 or 7); 0 out of view."""
    shown = np.zeros((len(optics), len(points)))
    for i in range(len(optics)):
        lens = lens_of(optics[i], positions[i], quaternions[i])
        for j in range(len(points)):
            point = points[j, 0], points[j, 1], points[j, 2]
            if not math.isnan(point[0]) and in_image(point, lens):
                shown[i, j] = detectability(lens.eye, point, pixel_size(lens, point), cylinders, grid)
    return shown


@compiled
def _find_shares_hidden(camera: Array, points: Array, cylinders: Array, tree_of: Indices, trees: int) -> Array:
    """Shares (N, T) of segments from a camera (3,) to points (N, 3) that trees, `tree_of` cylinders (B, 6), hide."""
    free, eye = np.ones((len(points), trees)), (camera[0], camera[1], camera[2])
    for j in range(len(points)):
        point = points[j, 0], points[j, 1], points[j, 2]
        for b in range(len(cylinders)):
            depth = optical_depth(eye, point, cylinder_of(cylinders, b), 0.0, 1.0)
            free[j, tree_of[b]] *= 0.0 if depth == math.inf else exp(-depth)
    return 1.0 - free


def detectable_shares(free: Array, pixel: float | Array = USUAL_PIXEL, slope: float | Array = USUAL_SLOPE) -> Array:
    """`detectable_share` of arrays that broadcast."""
    return _find_detectable_shares(free, pixel, slope)


@elementwise
@compiled
def _find_detectable_shares(free: Array, pixel: Array, slope: Array) -> Array:
    out = np.empty(len(free))
    for k in range(len(free)):
        out[k] = detectable_share(free[k], pixel[k], slope[k])
    return out


def _compute_centroids(count: int) -> Array:
    """Means of `count` equally probable parts of a standard normal distribution (count,)."""
    edges = normal_quantiles(np.arange(1, count) / count)
    density = np.concatenate([[0.0], exp_each(-0.5 * edges * edges) / math.sqrt(2 * math.pi), [0.0]])
    return np.asarray(count * (density[:-1] - density[1:]))


# Means (36, 2) of equally probable parts of a standard normal distribution in the plane, and the mean variance of these
# parts along each axis, which is 0.2 for outer parts and 0.02 for others. With an even number per axis no point lies on
# an edge through the mean, and the moments of either side are exact. Rules for smooth functions, such as Gauss-Hermite
# quadrature, give probabilities of 1/6 or 5/6 there.
SAMPLES = np.array([(a, b) for a in _compute_centroids(6) for b in _compute_centroids(6)])
_FARTHEST = 1.001 * float(np.max(SAMPLES))  # beyond the coordinates of all samples, in spite of rounding
SAMPLE_VARIANCE = float(1.0 - np.mean(np.square(_compute_centroids(6))))
# Detectable shares (36,) beyond which each sample counts as shown. A sample and the opposite one have the same, so that
# a share that is the same everywhere moves no belief. In this order, found by a search, the second moments of those
# that any share shows are within 0.10 of their part of all 36; the rest of a belief's width is lost or gained.
_PAIRS = np.array([14, 11, 1, 9, 6, 4, 7, 17, 3, 16, 15, 0, 5, 13, 8, 12, 10, 2])
_LEVELS = (np.argsort(_PAIRS, kind="stable") + 0.5) / 18
THRESHOLDS = np.concatenate([_LEVELS, _LEVELS[::-1]])


def visible_samples(forest: Forest, means: Array, covariances: Array, *frames: Lens | None) -> Flags:
    """Flags (N, F, 36) of the samples of each belief that F frames show: in the image and not hidden.

    Porous trees hide samples in part. Such a sample shows if its probability of detection exceeds its fixed threshold
    in `THRESHOLDS`: leaves stand still, so another frame from the same place shows the same samples.

    Beliefs: means (N, 2 or 4) and covariances (N, 2 or 4, 2 or 4) in m; the samples are mean + L `SAMPLES`, where L Lᵀ
    is the covariance of the position. frames: lenses as from `Camera.lens`; None shows nothing.
    """
    views = np.zeros((len(means), len(frames), len(SAMPLES)), np.bool_)
    for k, lens in enumerate(frames):
        if lens:
            views[:, k] = see_samples(means, covariances, lens, forest.occluders)
    return views


@compiled
def see_samples(means: Array, covariances: Array, lens: Lens, occluders: Occluders) -> Flags:
    """Flags (N, 36) of the samples of each belief that a frame shows, as `visible_samples`."""
    seen, roots = np.empty((len(means), len(SAMPLES)), dtype=np.bool_), np.empty((len(means), 2, 2))
    for i in range(len(means)):
        for a in range(2):
            for b in range(2):
                roots[i, a, b] = covariances[i, a, b]
    roots, cylinders, grid = cholesky_factors(roots), occluders.cylinders, occluders.grid
    for i in range(len(means)):
        if _is_outside(means[i], roots[i], lens):
            seen[i] = False
            continue
        for k in range(len(SAMPLES)):
            x = means[i, 0] + roots[i, 0, 0] * SAMPLES[k, 0]
            y = means[i, 1] + (roots[i, 1, 0] * SAMPLES[k, 0] + roots[i, 1, 1] * SAMPLES[k, 1])
            point = x, y, TARGET_HEIGHT
            shown = in_image(point, lens)
            shows = detectability(lens.eye, point, pixel_size(lens, point), cylinders, grid) if shown else 0.0
            seen[i, k] = shows > THRESHOLDS[k]
    return seen


@compiled
def _is_outside(mean: Array, root: Array, lens: Lens) -> bool:
    """True only if the image has none of the samples of a belief, as of most people in a large area.

    mean (2,) m or longer; root (2, 2) m, of the covariance. The samples are inside a parallelogram. If all its corners
    are in front of the camera and on the wrong side of one edge of the image, so is what is inside. Of distorted
    images each sample is looked at.
    """
    optics = lens.optics
    if optics.fx == 0.0 or optics.reach > 0.0:
        return False
    left = right = above = below = 0
    for k in range(4):
        a, b = _FARTHEST if k % 2 else -_FARTHEST, _FARTHEST if k < 2 else -_FARTHEST
        x, y = mean[0] + root[0, 0] * a, mean[1] + (root[1, 0] * a + root[1, 1] * b)
        u, v, depth = image_point(lens, (x, y, TARGET_HEIGHT))
        if depth > 0.0:
            left, right, above, below = (
                left + (u < 0.0),
                right + (u > optics.width),
                above + (v < 0.0),
                below + (v > optics.height),
            )
    return max(left, right, above, below) == 4
