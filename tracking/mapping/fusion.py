"""One map of trees from those that several UAVs made, each of frames of its own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tracking.geometry.line_of_sight import Raster
from tracking.geometry.visibility import Tree
from tracking.mapping.mapper import MappedTree
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.assignment import pairs_within
from tracking.numerics.distances import length
from tracking.numerics.factorisation import inverses

_GATE = 16.3  # squared Mahalanobis distance of place and radius, which one tree exceeds with probability 0.001
_NEAR = 0.5  # of the smaller radius: centres that are nearer are those of one tree, as two cannot stand there
_OVERLOOKED = 0.02  # probability that a map has open ground where a tree stands
_LIKELY = 0.5  # existence of trees that are believed
_NUMBERS = 15  # of a tree, eight bytes each: five sizes, covariances (6 and 2), existence and rim


@dataclass(frozen=True, eq=False)
class TreeMap:
    """Trees that a UAV mapped, and the ground that it saw.

    Attributes:
        trees: the trees.
        ground: 1 where open, 0 below crowns, NaN where not yet seen, in the cells of a raster.
    """

    trees: tuple[MappedTree, ...]
    ground: Raster

    @property
    def size(self) -> int:
        """Bytes of a message with it; four cells of the ground share a byte."""
        return 8 * _NUMBERS * len(self.trees) + (self.ground.values.size + 3) // 4


def fuse_maps(maps: Sequence[TreeMap]) -> TreeMap:
    """Fuse the maps of UAVs, one each, on one raster; the same maps in the same order give the same result.

    Errors of different UAVs are taken to be independent, so trees that are one are fused by their information. The odds
    that a tree exists, which are even beforehand, are multiplied over the maps that have it, and lowered by those that
    have open ground there. Ground is open if one map has it open. Each map has to be of its own UAV's frames alone;
    then nothing is counted twice.
    """
    found: list[tuple[MappedTree, set[int]]] = []  # trees, each with the maps that have it
    for n, other in enumerate(maps):
        pairs = dict(_pair([tree for tree, _ in found], other.trees))
        found = [
            (_join(tree, other.trees[pairs[a]]), {*having, n}) if a in pairs else (tree, having)
            for a, (tree, having) in enumerate(found)
        ]
        matched = set(pairs.values())
        found += [(tree, {n}) for b, tree in enumerate(other.trees) if b not in matched]
    doubted = [
        _doubt(tree, [other.ground for n, other in enumerate(maps) if n not in having]) for tree, having in found
    ]
    trees = [tree for tree in doubted if tree.existence >= _LIKELY]
    values = np.full(maps[0].ground.values.shape, np.nan)
    for other in maps:
        values = np.fmax(values, other.ground.values)
    for tree in trees:
        values[_below(tree.tree, maps[0].ground)] = 0.0
    return TreeMap(tuple(trees), maps[0].ground._replace(values=values))


def _list_sizes(trees: Sequence[MappedTree]) -> Array:
    """Rows (N, 5) of x, y, crown radius, base and top [m]."""
    rows = [(t.tree.x, t.tree.y, t.tree.canopy_radius, t.tree.canopy_base, t.tree.canopy_top) for t in trees]
    return np.array(rows, dtype=float).reshape(-1, 5)


def _pair(ours: Sequence[MappedTree], others: Sequence[MappedTree]) -> list[tuple[int, int]]:
    """Pairs of indices of trees of two maps that are one tree: near to each other, or within the gate."""
    if not ours or not others:
        return []
    one, other = _list_sizes(ours), _list_sizes(others)
    gaps = length(one[:, None, :2] - other[None, :, :2])
    near = gaps < _NEAR * np.minimum(one[:, None, 2], other[None, :, 2])
    near |= _find_distances(ours, others) <= _GATE
    return pairs_within(np.where(near, gaps, np.inf), float(gaps.max()) + 1.0)


def _find_distances(ours: Sequence[MappedTree], others: Sequence[MappedTree]) -> Array:
    """Squared Mahalanobis distances (N, M) of places and radii."""
    one, other = (_list_sizes(trees)[:, :3] for trees in (ours, others))
    own, theirs = (np.array([tree.covariance[:3, :3] for tree in trees]) for trees in (ours, others))
    inverse = inverses((own[:, None] + theirs[None]).reshape(-1, 3, 3)).reshape(len(ours), len(others), 3, 3)
    gaps = one[:, None] - other[None]
    distances = np.zeros(gaps.shape[:2])
    for p in range(3):
        for q in range(3):
            distances += gaps[..., p] * inverse[..., p, q] * gaps[..., q]
    return distances


def _join(one: MappedTree, other: MappedTree) -> MappedTree:
    """One tree of two estimates of it, or the one of which more of the rim was seen if they are beyond the gate.

    With covariances P and Q (5, 5) m² and sizes x and y (5,) m the result has (P⁻¹ + Q⁻¹)⁻¹ and the mean of x and y
    that is weighted by P⁻¹ and Q⁻¹: the fusion of independent estimates.
    """
    odds = _find_odds(one) * _find_odds(other)
    longer = max(one, other, key=lambda tree: tree.rim * tree.tree.canopy_radius)
    existence = odds / (1.0 + odds)
    if float(_find_distances([one], [other])[0, 0]) > _GATE:
        return replace(longer, existence=existence)
    ours, theirs = inverses(np.stack([one.covariance, other.covariance]))
    covariance = inverses((ours + theirs)[None])[0]
    (own, other_sizes), fused = _list_sizes([one, other]), np.zeros(5)
    for p in range(5):
        for q in range(5):
            for r in range(5):
                fused[p] += covariance[p, q] * (ours[q, r] * own[r] + theirs[q, r] * other_sizes[r])
    x, y, radius, base, top = fused.tolist()
    tree = replace(
        one.tree, x=x, y=y, canopy_radius=max(radius, 0.1), canopy_base=max(min(base, top), 0.0), canopy_top=top
    )
    return MappedTree(tree, covariance, existence, longer.rim)


def _find_odds(tree: MappedTree) -> float:
    return tree.existence / max(1.0 - tree.existence, 1e-12)


def _doubt(tree: MappedTree, grounds: Sequence[Raster]) -> MappedTree:
    """A tree after its odds are lowered by each map without it in which most of its place is open ground."""
    odds, doubts = _find_odds(tree), 0
    for ground in grounds:
        values = ground.values[_below(tree.tree, ground)]
        if np.count_nonzero(values == 1.0) > 0.5 * len(values):
            odds *= _OVERLOOKED
            doubts += 1
    return replace(tree, existence=odds / (1.0 + odds)) if doubts else tree


def _below(tree: Tree, ground: Raster) -> Flags:
    """Mask of the cells below a crown."""
    rows, columns = ground.values.shape
    (west, south), (width, height) = ground.low, ground.cell
    east = west + (np.arange(columns) + 0.5) * width - tree.x
    north = south + (np.arange(rows) + 0.5) * height - tree.y
    return np.asarray(np.square(east) + np.square(north)[:, None] <= tree.canopy_radius * tree.canopy_radius)
