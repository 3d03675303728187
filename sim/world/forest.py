"""The forest: seeded placement of trees."""

import math

import numpy as np
from scipy.spatial import cKDTree

from sim.scenario.environment import Area, Trees
from tracking.errors import InputError
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.poisson import draw_poisson

MAX_TREES = 10_000
CLEARANCE = 0.5  # m, least distance from the bark of a trunk to a point that is to be kept clear
_ATTEMPTS = 200_000  # draws for all trees together; near jamming, more would add few trees
_BATCH = 1000
_NOWHERE = np.zeros((0, 2))


def grow(trees: Trees, area: Area, rng: np.random.Generator, keep_clear: Array = _NOWHERE) -> Forest:
    """A Poisson forest without overlap of canopies.

    The number of trees is Poisson with the expectation `trees.density`, or that of `trees.per_hectare`. Centres are
    uniform in the area by random sequential addition: each tree, the largest first, is drawn again until its canopy
    touches no earlier one. keep_clear (n, 2) m: points on which no trunk may stand. InputError if the forest does not
    fit into the area.
    Source: [Li22] IV-A.
    """
    expected = trees.expected_count(area)
    if expected > _most(trees, area):
        raise _too_dense(trees, area, f"no more than {_most(trees, area):.0f}")
    count = draw_poisson(rng, expected)
    radii = np.full(count, trees.canopy_radius)
    if trees.largest_radius is not None:
        radii = np.sort(rng.uniform(trees.canopy_radius, trees.largest_radius, count))[::-1]
    centres = _place(radii, trees, area, rng, keep_clear)
    if len(centres) < count:
        raise _too_dense(trees, area, f"this seed asks for {count}, and only {len(centres)}")
    shape = (trees.canopy_base, trees.canopy_top, trees.trunk_radius)
    return Forest(tuple(Tree(x, y, r, *shape) for (x, y), r in zip(centres.tolist(), radii.tolist(), strict=True)))


def _most(trees: Trees, area: Area) -> float:
    """Upper bound of the number of trees of the smallest radius in the area, by the densest packing of discs."""
    reach = 2 * trees.canopy_radius
    packed = math.pi / math.sqrt(12) * (area.width + reach) * (area.height + reach)
    return min(packed / (math.pi * trees.canopy_radius * trees.canopy_radius), MAX_TREES)


def _too_dense(trees: Trees, area: Area, fit: str) -> InputError:
    key = "density" if trees.per_hectare is None else "per_hectare"
    upper = "" if trees.largest_radius is None else f" to {trees.largest_radius:g}"
    return InputError(
        f"trees.{key} = {getattr(trees, key):g}: {fit} trees with canopies of {trees.canopy_radius:g}{upper} m radius "
        f"fit into {area.width:g} x {area.height:g} m without overlap; lower the density or the radius"
    )


def _place(radii: Array, trees: Trees, area: Area, rng: np.random.Generator, keep_clear: Array) -> Array:
    """Centres (n, 2) m of trees with these descending radii; fewer than all if the attempts are used up."""
    half = np.array([area.width, area.height]) / 2
    count = len(radii)
    centres, n = np.empty((count, 2)), 0
    for _ in range(0, _ATTEMPTS, _BATCH):
        # Candidates are checked in the order drawn, so the result is the same as if they were drawn one by one.
        candidates = rng.uniform(-half, half, (_BATCH, 2))
        least = 2 * radii[-1] if count else 0.0  # a distance at which a smaller, later tree may still fit
        free = _apart(candidates, centres[:n], least)
        free &= _apart(candidates, keep_clear, trees.trunk_radius + CLEARANCE)
        for candidate in candidates[free]:
            if n == count:
                return centres
            if _fits(candidate, radii[n], centres[:n], radii):
                centres[n] = candidate
                n += 1
    return centres[:n]


@compiled
def _fits(centre: Array, radius: float, centres: Array, radii: Array) -> bool:
    """True if a disc overlaps none of those at centres (n, 2) m with radii (n or more,) m."""
    for k in range(len(centres)):
        east, north = centres[k, 0] - centre[0], centres[k, 1] - centre[1]
        if math.sqrt(east * east + north * north) < radii[k] + radius:
            return False
    return True


def _apart(points: Array, others: Array, distance: float) -> Flags:
    """Mask (n,) of the points (n, 2) m that are at least a distance [m] from all others (m, 2) m."""
    return np.asarray(cKDTree(others).query(points)[0] >= distance)
