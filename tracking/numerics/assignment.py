"""Assignment of rows to columns at the least cost."""

from bisect import bisect_left

import numpy as np
from scipy.optimize import linear_sum_assignment

from tracking.numerics.arrays import Array, Flags


def most_pairs(allowed: Flags, cost: Array) -> list[tuple[int, int]]:
    """As many allowed pairs (A, B) as possible, at the least cost (A, B); no pair has an infinite or NaN cost."""
    finite = np.isfinite(cost)
    allowed = allowed & finite
    # A pair that is not allowed costs more than all others together, so the assignment makes as many as it can.
    ceiling = 1.0 + np.abs(np.where(finite, cost, 0.0)).sum()
    rows, columns = linear_sum_assignment(np.where(allowed, cost, ceiling))
    return [(a, b) for a, b in zip(rows.tolist(), columns.tolist(), strict=True) if allowed[a, b]]


def pairs_within(cost: Array, gate: float) -> list[tuple[int, int]]:
    """Pairs of cost (A, B) up to `gate`, at the least total cost, where `gate` replaces the cost of a pair left out."""
    rows, columns = linear_sum_assignment(np.fmin(cost, gate))
    return [(a, b) for a, b in zip(rows.tolist(), columns.tolist(), strict=True) if cost[a, b] <= gate]


def least_costs(cost: Array | Flags) -> Array:
    """Costs (min(A, B),) of the pairs of least total cost, each row and column in one pair at most."""
    return np.asarray(cost[linear_sum_assignment(cost)])


def least_largest_costs(cost: Array, cutoff: float) -> Array:
    """Costs (K,) below the cut-off of as many pairs as possible; the largest of them is as small as possible."""
    levels = np.unique(cost[cost < cutoff])
    fewest = np.count_nonzero(least_costs(cost >= cutoff))  # pairs that reach the cut-off, however they are made
    k = bisect_left(levels, True, key=lambda most: np.count_nonzero(least_costs(cost > most)) == fewest)
    pairs = cost[linear_sum_assignment(cost > levels[k])] if len(levels) else np.zeros(0)
    return np.asarray(pairs[pairs < cutoff])
