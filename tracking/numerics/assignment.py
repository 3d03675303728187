"""Assignment of rows to columns at the least cost."""

from bisect import bisect_left

import numpy as np

from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, merged


def most_pairs(allowed: Flags, cost: Array) -> list[tuple[int, int]]:
    """As many allowed pairs (A, B) as possible, at the least cost (A, B); no pair has an infinite or NaN cost."""
    finite = np.isfinite(cost)
    allowed = allowed & finite
    # A pair that is not allowed costs more than all others together, so the assignment makes as many as it can.
    ceiling = 1.0 + np.abs(np.where(finite, cost, 0.0)).sum()
    rows, columns = assign(np.where(allowed, cost, ceiling))
    return [(a, b) for a, b in zip(rows.tolist(), columns.tolist(), strict=True) if allowed[a, b]]


def pairs_within(cost: Array, gate: float) -> list[tuple[int, int]]:
    """Pairs of cost (A, B) up to `gate`, at the least total cost, where `gate` replaces the cost of a pair left out."""
    rows, columns = assign(np.fmin(cost, gate))
    return [(a, b) for a, b in zip(rows.tolist(), columns.tolist(), strict=True) if cost[a, b] <= gate]


def least_costs(cost: Array | Flags) -> Array:
    """Costs (min(A, B),) of the pairs of least total cost, each row and column in one pair at most."""
    return np.asarray(cost[assign(cost)])


def least_largest_costs(cost: Array, cutoff: float) -> Array:
    """Costs (K,) below the cut-off of as many pairs as possible; the largest of them is as small as possible."""
    levels = np.unique(cost[cost < cutoff])
    fewest = np.count_nonzero(least_costs(cost >= cutoff))  # pairs that reach the cut-off, however they are made
    k = bisect_left(levels, True, key=lambda most: np.count_nonzero(least_costs(cost > most)) == fewest)
    pairs = cost[assign(cost > levels[k])] if len(levels) else np.zeros(0)
    return np.asarray(pairs[pairs < cutoff])


def assign(cost: Array | Flags) -> tuple[Indices, Indices]:
    """Rows, in order, and columns of the pairs of least total cost (A, B); each has one pair at most.

    ValueError if a cost is NaN or -inf, or if every assignment has an infinite cost. Of several best assignments it is
    that of SciPy's `linear_sum_assignment`, whose import takes longer than a mission's other imports together.
    """
    costs = np.ascontiguousarray(cost, dtype=float)
    if len(costs) <= costs.shape[1]:
        columns = _find_columns(costs)
        return np.arange(len(columns)), columns
    rows = _find_columns(np.ascontiguousarray(costs.T))
    order = np.argsort(rows, kind="stable")
    return rows[order], order


@compiled
def _find_columns(cost: Array) -> Indices:
    """Column of each row at the least total cost (A, B), where A is at most B, by shortest augmenting paths.

    Source: [Crouse16], as in SciPy.
    """
    rows, columns = cost.shape
    for value in cost.flat:
        if np.isnan(value) or value == -np.inf:
            raise ValueError("cost: NaN and -inf are not allowed")
    prices = np.zeros(rows), np.zeros(columns)
    column_of, row_of = np.full(rows, -1), np.full(columns, -1)
    via = np.full(columns, -1)  # row before each column on the shortest path to it
    for new in range(rows):
        reached = np.zeros(rows, dtype=np.bool_), np.zeros(columns, dtype=np.bool_)
        costs = np.full(columns, np.inf)  # of the shortest path to each column
        end, lowest = _find_path(cost, new, prices, row_of, via, costs, reached)
        if end == -1:
            raise ValueError("cost: no assignment has a finite cost")
        prices[0][new] += lowest
        for i in range(rows):
            if reached[0][i] and i != new:
                prices[0][i] += lowest - costs[column_of[i]]
        for j in range(columns):
            if reached[1][j]:
                prices[1][j] -= lowest - costs[j]
        row, j = -1, end
        while row != new:
            row = via[j]
            row_of[j] = row
            column_of[row], j = j, column_of[row]
    return column_of


@merged
def _find_path(
    cost: Array,
    new: int,
    prices: tuple[Array, Array],
    row_of: Indices,
    via: Indices,
    costs: Array,
    reached: tuple[Flags, Flags],
) -> tuple[int, float]:
    """The free column at the end of the shortest path from a new row, -1 if there is none, and the path's cost.

    Fills in `via`, `costs` and `reached`; prices and reached are those of rows and of columns.
    """
    count = len(row_of)
    left = np.arange(count - 1, -1, -1)  # columns to which the shortest path is not known yet
    row, lowest = new, 0.0
    while True:
        reached[0][row] = True
        nearest, before, lowest = -1, lowest, np.inf
        for k in range(count):
            j = left[k]
            found = before + cost[row, j] - prices[0][row] - prices[1][j]
            if found < costs[j]:
                via[j] = row
                costs[j] = found
            if costs[j] < lowest or (costs[j] == lowest and row_of[j] == -1):
                lowest = costs[j]
                nearest = k
        if lowest == np.inf:
            return -1, lowest
        j = left[nearest]
        reached[1][j] = True
        if row_of[j] == -1:
            return j, lowest
        row = row_of[j]
        count -= 1
        left[nearest] = left[count]
