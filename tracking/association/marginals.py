"""Marginal association probabilities of one-to-one matchings: exact, or by loopy belief propagation."""

import numpy as np

from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled

# Enumeration costs (larger side) x (smaller side) x 2^(smaller side) of a cluster. Beyond this side loopy belief
# propagation takes over, so that a scan of fifty people takes less than 5 ms whatever the clusters.
EXACT_SIDE = 10
_ITERATIONS = 1000
_MESSAGES = 10_000  # to each track, on average: where gates hold more than 10 measurements, iterations are fewer
_TOLERANCE = 1e-9  # not more: among many people messages may hardly change for a hundred iterations, and then change


@compiled
def marginals(misses: Array, pairs: Array, exact_side: int) -> Array:
    """Probabilities (T, N + 1) of no measurement, or of each, from weights of misses (T,) and of pairs (T, N).

    A matching weighs the product of its pairs and of the misses of the other tracks. Tracks that share measurements,
    directly or through other tracks, form a cluster; a cluster with a smaller side above `exact_side` is approximated.
    """
    beta = np.zeros((pairs.shape[0], pairs.shape[1] + 1))
    done = np.zeros(len(pairs), dtype=np.bool_)
    for start in range(len(pairs)):
        if done[start]:
            continue
        rows, columns = _cluster(pairs, start)
        done[rows] = True
        solved = _solve(misses[rows], pairs[rows][:, columns], exact_side)
        for i in range(len(rows)):
            beta[rows[i], 0] = solved[i, 0]
            for j in range(len(columns)):
                beta[rows[i], columns[j] + 1] = solved[i, j + 1]
    return beta


@compiled
def _cluster(pairs: Array, start: int) -> tuple[Indices, Indices]:
    """Tracks and measurements, ascending, of the cluster of the track `start`."""
    rows = np.zeros(pairs.shape[0], dtype=np.bool_)
    columns = np.zeros(pairs.shape[1], dtype=np.bool_)
    rows[start] = True
    pending = [start]
    while len(pending) > 0:
        i = pending.pop()
        for j in range(len(columns)):
            if pairs[i, j] > 0.0 and not columns[j]:
                columns[j] = True
                for k in range(len(rows)):
                    if pairs[k, j] > 0.0 and not rows[k]:
                        rows[k] = True
                        pending.append(k)
    return np.nonzero(rows)[0], np.nonzero(columns)[0]


@compiled
def _solve(misses: Array, pairs: Array, exact_side: int) -> Array:
    """Marginals of one cluster (T, N + 1)."""
    rows, columns = pairs.shape
    beta = np.empty((rows, columns + 1))
    if columns == 0:
        beta[:, 0] = 1.0
    elif min(rows, columns) > exact_side:
        beta[:, 1:], beta[:, 0] = _propagate(pairs, misses)
    elif columns <= rows:
        beta[:, 1:], beta[:, 0], _ = _enumerate(pairs, misses, np.ones(columns))
    else:
        flipped, _, beta[:, 0] = _enumerate(pairs.T.copy(), np.ones(columns), misses)
        beta[:, 1:] = flipped.T
    return beta


@compiled
def _enumerate(pairs: Array, row_free: Array, column_free: Array) -> tuple[Array, Array, Array]:
    """Exact marginals over all matchings of rows to columns, by dynamic programming over sets of used columns.

    A matching weighs the product of its pairs (R, C), of `row_free` (R,) over the rows and of `column_free` (C,)
    over the columns that it leaves out. Returns the probabilities of pairs, free rows and free columns. The forward
    and backward sums of each row are rescaled: only their ratios matter.
    """
    rows, columns = pairs.shape
    sets = np.arange(1 << columns)  # of columns, as bits
    without = [sets[sets >> c & 1 == 0] for c in range(columns)]
    forward, backward = np.zeros((rows + 1, len(sets))), np.ones(len(sets))
    forward[0, 0] = 1.0
    for r in range(rows):
        after = row_free[r] * forward[r]
        for c in range(columns):
            for used in without[c]:
                after[used | 1 << c] += pairs[r, c] * forward[r, used]
        forward[r + 1] = after / after.max()
    for c in range(columns):
        backward[without[c]] *= column_free[c]
    last = forward[rows] * backward
    free_columns = np.array([last[free].sum() for free in without]) / last.sum()
    matched, free_rows = np.empty((rows, columns)), np.empty(rows)
    for r in range(rows - 1, -1, -1):
        before = row_free[r] * backward
        free_rows[r] = (forward[r] * before).sum()
        for c in range(columns):
            bit, weight, total = 1 << c, pairs[r, c], 0.0
            for used in without[c]:
                rest = weight * backward[used | bit]
                total += forward[r, used] * rest
                before[used] += rest
            matched[r, c] = total
        total = free_rows[r] + matched[r].sum()
        free_rows[r] /= total
        matched[r] /= total
        backward = before / before.max()
    return matched, free_rows, free_columns


@compiled
def _propagate(pairs: Array, misses: Array) -> tuple[Array, Array]:
    """Marginals of pairs and free rows by loopy belief propagation: exact without cycles. Source: [Williams14].

    It converges from any start. Where misses and clutter have little weight that takes long, and it stops earlier:
    marginals of up to 50 people in a square are then within 0.005 of the limit, or within 0.02 if all people are within
    4 m and there is hardly any clutter.
    """
    where = np.flatnonzero(pairs)  # one message in each direction for each possible pair
    rows, columns, weights = where // pairs.shape[1], where % pairs.shape[1], pairs.ravel()[where]
    by_row, by_column = np.arange(len(rows)), np.argsort(columns, kind="mergesort")
    row_starts = np.searchsorted(rows, np.arange(len(misses) + 1))
    column_starts = np.searchsorted(columns[by_column], np.arange(pairs.shape[1] + 1))
    clutter = np.ones(pairs.shape[1])
    back, values, sums = np.ones(len(rows)), np.empty(len(rows)), np.empty(len(rows))
    for _ in range(min(_ITERATIONS, _MESSAGES * len(misses) // len(rows))):
        for e in range(len(rows)):
            values[e] = weights[e] * back[e]
        _others(values, misses, by_row, row_starts, sums)
        for e in range(len(rows)):
            values[e] = weights[e] / sums[e]
        _others(values, clutter, by_column, column_starts, sums)
        change = 0.0
        for e in range(len(rows)):
            new = 1.0 / sums[e]
            change = max(change, abs(new - back[e]))
            back[e] = new
        if change < _TOLERANCE:
            break
    matched, free = np.zeros_like(pairs), misses.copy()
    for e in range(len(rows)):
        matched[rows[e], columns[e]] = weights[e] * back[e]
    for i in range(len(misses)):
        total = misses[i] + matched[i].sum()
        matched[i] /= total
        free[i] /= total
    return matched, free


@compiled
def _others(values: Array, bases: Array, members: Indices, starts: Indices, sums: Array) -> None:
    """Write for each value the base plus all other values of its group, without differences and their cancellation.

    Group g is members[starts[g] : starts[g + 1]] of the values and has the base bases[g]; the result goes to `sums`.
    """
    for g in range(len(bases)):
        left, right = bases[g], 0.0
        for k in range(starts[g], starts[g + 1]):
            sums[members[k]] = 0.0
        for k in range(starts[g + 1] - starts[g]):  # in both directions at once: neither sum waits for the other
            first, last = members[starts[g] + k], members[starts[g + 1] - 1 - k]
            sums[first] += left
            left += values[first]
            sums[last] += right
            right += values[last]
