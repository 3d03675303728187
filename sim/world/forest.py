"""The random forest: seeded sizes and places of trees."""

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from sim.scenario.environment import Area, Trees
from tracking.errors import InputError
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp, log, power
from tracking.numerics.poisson import draw_poisson

MAX_TREES = 10_000
PATH_GAP = 0.5  # m, least distance from the bark of a trunk to a point that is to be kept clear
GAP = 1.0  # m, least distance between the barks of two trees whose crowns may overlap, so that people pass
CROWN_SHARE = 0.5  # of the height of a tree, which its crown takes
_ATTEMPTS = 200_000  # draws for all trees together; near jamming, more would add few trees
_BATCH = 1000
_NOWHERE = np.zeros((0, 2))


class Sizes(NamedTuple):
    """Sizes of T trees [m], each (T,), the widest crown first."""

    crown_radii: Array
    crown_bases: Array
    heights: Array
    trunk_radii: Array


def grow(trees: Trees, area: Area, rng: np.random.Generator, keep_clear: Array = _NOWHERE) -> Forest:
    """A Poisson forest in which canopies do not overlap, unless `trees.overlap` allows it.

    The number of trees is Poisson with the expectation `trees.density`, or that of `trees.per_hectare`. Centres are
    uniform in the area by random sequential addition: each tree, the widest first, is drawn again until its canopy
    touches no earlier one, or with overlap until its trunk is `GAP` from the others. keep_clear (n, 2) m: points on
    which no trunk may stand. InputError if the forest does not fit into the area.
    Source: [Li22] IV-A.
    """
    expected = trees.expected_count(area)
    least = _find_least_distance(trees) / 2
    if expected > _bound_number(least, area):
        raise _explain_density(trees, area, f"no more than {_bound_number(least, area):.0f}")
    sizes = _draw_sizes(trees, draw_poisson(rng, expected), rng)
    count = len(sizes.heights)
    room = sizes.trunk_radii + GAP / 2 if trees.overlap else sizes.crown_radii
    centres = _place(room, sizes.trunk_radii, area, rng, keep_clear)
    if len(centres) < count:
        raise _explain_density(trees, area, f"this seed asks for {count}, and only {len(centres)}")
    density = np.full(count, trees.leaf_area)
    return Forest(tuple(Tree(*row) for row in np.column_stack([centres, *sizes, density]).tolist()))


def _draw_sizes(trees: Trees, count: int, rng: np.random.Generator) -> Sizes:
    """Sizes of as many trees."""
    if trees.height is not None:
        heights = np.sort(rng.uniform(*trees.height, count))[::-1]
        crowns, trunks = (np.array(list(map(radius, heights.tolist()))) for radius in (crown_radius, trunk_radius))
        return Sizes(crowns, heights * (1 - CROWN_SHARE), heights, trunks)
    radii = np.full(count, trees.canopy_radius)
    if trees.largest_radius is not None:
        radii = np.sort(rng.uniform(trees.canopy_radius, trees.largest_radius, count))[::-1]
    return Sizes(radii, *(np.full(count, size) for size in (trees.canopy_base, trees.canopy_top, trees.trunk_radius)))


def trunk_radius(height: float) -> float:
    """Radius [m] of the trunk at breast height of a tree of a height [m], for a mean climate.

    Source: [Chave14] eq. (6a) with E = 0, solved for the diameter D [cm]: ln H = 0.893 + 0.760 ln D - 0.0340 (ln D)².
    """
    root = math.sqrt(0.760 * 0.760 - 4 * 0.0340 * (log(height) - 0.893))
    return exp((0.760 - root) / (2 * 0.0340)) / 200


def crown_radius(height: float, trunk: float | None = None) -> float:
    """Radius [m] of the crown of a tree of a height [m], whose trunk has a radius [m], by default `trunk_radius`.

    Source: [Jucker17] for all trees, solved for the crown's diameter C [m]: D = 0.557 (H C)^0.809 exp(0.056² / 2).
    """
    diameter = 200 * (trunk_radius(height) if trunk is None else trunk)
    return power(diameter / (0.557 * exp(0.056 * 0.056 / 2)), 1 / 0.809) / height / 2


def _find_least_distance(trees: Trees) -> float:
    """Least distance [m] between two trees of the smallest size."""
    if trees.overlap:
        return GAP + 2 * (trees.trunk_radius if trees.height is None else trunk_radius(trees.height[0]))
    return 2 * (trees.canopy_radius if trees.height is None else crown_radius(trees.height[0]))


def _bound_number(radius: float, area: Area) -> float:
    """Upper bound of the number of discs of a radius [m] in the area, by the densest packing."""
    reach = 2 * radius
    packed = math.pi / math.sqrt(12) * (area.width + reach) * (area.height + reach)
    return min(packed / (math.pi * radius * radius), MAX_TREES)


def _explain_density(trees: Trees, area: Area, fit: str) -> InputError:
    key = "density" if trees.per_hectare is None else "per_hectare"
    upper = "" if trees.largest_radius is None else f" to {trees.largest_radius:g}"
    sizes = f"with canopies of {trees.canopy_radius:g}{upper} m radius"
    if trees.height is not None:
        sizes = f"of {trees.height[0]:g} to {trees.height[1]:g} m height"
    how = f"{GAP:g} m apart" if trees.overlap else "without overlap"
    size = f"{area.width:g} x {area.height:g} m {how}"
    return InputError(
        f"trees.{key} = {getattr(trees, key):g}: {fit} trees {sizes} fit into {size}; "
        f"lower the density or the size{'' if trees.overlap else ', or allow trees.overlap'}"
    )


def _place(radii: Array, trunks: Array, area: Area, rng: np.random.Generator, keep_clear: Array) -> Array:
    """Centres (n, 2) m of trees, apart by the sums of their descending `radii`; fewer if the attempts are used up.

    trunks: radii (T,) m of the trunks, of which none may cover a point to keep clear.
    """
    thickest = float(trunks.max(initial=0.0))
    half = np.array([area.width, area.height]) / 2
    count = len(radii)
    centres = np.empty((count, 2))
    n = 0
    for _ in range(0, _ATTEMPTS, _BATCH):
        # Candidates are checked in the order drawn, so the result is the same as if they were drawn one by one.
        candidates = rng.uniform(-half, half, (_BATCH, 2))
        least = 2 * radii[-1] if count else 0.0  # a distance at which a smaller, later tree may still fit
        free = _are_apart(candidates, centres[:n], least)
        free &= _are_apart(candidates, keep_clear, thickest + PATH_GAP)
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


def _are_apart(points: Array, others: Array, distance: float) -> Flags:
    """Mask (n,) of the points (n, 2) m that are at least a distance [m] from all others (m, 2) m."""
    return np.asarray(cKDTree(others).query(points)[0] >= distance)
