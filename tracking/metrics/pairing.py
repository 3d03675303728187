"""Pairs of two sets with the least distance of an order p, and sums of powers of any size."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from tracking.numerics.arrays import Array
from tracking.numerics.assignment import least_costs, most_pairs
from tracking.numerics.exponential import power, power_each

_SMALL, _LARGE = 1e-280, 1e280  # between these, powers and their sums are neither rounded to zero nor infinite
_FARTHEST = 1e150  # m, largest coordinate: squares of larger ones are infinite


class Part(NamedTuple):
    """Part of a distance between sets."""

    distances: Array  # (N,) m
    factor: float  # of the power of each distance in the sum


def check_metric(c: float, p: float) -> None:
    """Raise ValueError unless the cut-off c and the order p are those of a metric; both may be infinite."""
    if not (c > 0 and p >= 1):
        raise ValueError(f"c must be positive and p at least 1, are {c} and {p}")


def check_positions(name: str, positions: Array) -> Array:
    """Return positions as an array (A, 2); an empty one may also be (0,) or (0, n).

    Raises ValueError for other shapes, as of states, and for positions that are not finite or beyond 1e150 m.
    """
    found = np.asarray(positions, dtype=float)
    if found.ndim > 2 or (found.size and found.shape[1:] != (2,)):
        raise ValueError(f"{name} must be (A, 2), are {found.shape}")
    found = found.reshape(-1, 2)
    if not all(-_FARTHEST <= x <= _FARTHEST for x in found.ravel().tolist()):  # faster than NumPy's for a few
        first = (np.abs(found) <= _FARTHEST).all(axis=1).argmin()
        if np.isfinite(found[first]).all():
            raise ValueError(f"{name}[{first}] is beyond {_FARTHEST:g} m")
        raise ValueError(f"{name}[{first}] is not finite; leave absent ones out")
    return found


def nearest_pairs(gaps: Array, c: float, p: float) -> Array:
    """Distances (min(A, B),) m, no more than c, of the pairs with the least sum of p-th powers.

    gaps (A, B) m; each member is in one pair at most. For p = inf as few pairs as possible are c apart, and the largest
    distance of the others is as small as possible: the limit of large p.
    """
    near = np.minimum(gaps, c)
    if not near.size:
        return np.zeros(0)
    if p == math.inf:
        return _find_least_largest(near, c)
    costs = power_each(near, p)
    if costs.max() < _LARGE:
        found = near[linear_sum_assignment(costs)]
        if found.max() == 0.0 or power_each(found, p).sum() > _SMALL:
            return np.asarray(found)
    # Relative to the largest distance that any pairing has, powers are neither too large nor too small. The best pairs
    # cost between 1 and their number, so that costs may be cut off beyond.
    least = _find_least_largest(near, c)
    unit = float(least.max())
    if unit in (0.0, math.inf):
        return least
    costs = np.minimum(power_each(np.minimum(near, 2.0 * unit) / unit, p), len(near) + 1.0)
    return np.asarray(near[linear_sum_assignment(costs)])


def plain_costs(gaps: Array, c: float, p: float) -> Array | None:
    """Powers (min(A, B),) of the distances of the pairs with the least sum, those of c included.

    None where plain powers and sums leave the range of floats, or may: then `nearest_pairs` and `norm` help. For the
    metrics of missions this takes a third of their time.
    """
    if p == math.inf or not _SMALL < power(c, p) < _LARGE:
        return None
    costs = least_costs(power_each(np.minimum(gaps, c), p))
    return costs if len(costs) == 0 or costs.min() > _SMALL else None


def norm(parts: Sequence[Part], p: float, count: int = 1) -> float:
    """The p-th root of the sum of p-th powers of all distances, divided by `count`; for p = inf the largest distance.

    Where the sum would leave the range of floats, distances are divided by the largest one first.
    """
    parts = [part for part in parts if len(part.distances) and part.factor > 0]
    largest = max((float(part.distances.max()) for part in parts), default=0.0)
    if p == math.inf or largest in (0.0, math.inf):
        return largest
    total = _sum_powers(parts, p, count, 1.0)
    if _SMALL < total < _LARGE:
        return float(power(total, 1 / p))
    return largest * power(_sum_powers(parts, p, count, largest), 1 / p)


def _sum_powers(parts: Sequence[Part], p: float, count: int, unit: float) -> float:
    """Sum of powers divided by `count`, with distances in multiples of `unit` m."""
    total = 0.0
    for distances, factor in parts:
        total += float(power_each(distances / unit, p).sum()) * factor / count
    return total


def _find_least_largest(near: Array, c: float) -> Array:
    """Distances (min(A, B),) m of as many pairs less than c apart as possible, their largest as small as possible.

    The other pairs are c apart. near (A, B) m, no more than c.
    """
    inside = near < c
    most = min(near.shape) - int(least_costs((~inside).astype(float)).sum())
    limits = np.unique(near[inside])  # one of these is the largest distance: bisection
    low, high = 0, len(limits) - 1
    while low < high:
        middle = (low + high) // 2
        enough = min(near.shape) - int(least_costs((near > limits[middle]).astype(float)).sum()) >= most
        low, high = (low, middle) if enough else (middle + 1, high)
    pairs = most_pairs(near <= limits[low], near) if most else []
    return np.array([near[a, b] for a, b in pairs] + [c] * (min(near.shape) - most))
