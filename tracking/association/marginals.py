"""Marginal association probabilities of one-to-one matchings: exact, or by loopy belief propagation."""

import numpy as np

from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled

# Enumeration costs (larger side) x (smaller side) x 2^(smaller side) of a cluster. Beyond this side loopy belief
# propagation takes over, so that a scan of fifty people takes less than 5 ms whatever the clusters.
EXACT_SIDE = 10
_ITERATIONS = 1000
_MESSAGES = 10_000  # most messages per track on average: fewer iterations if gates contain more than 10 measurements
_TOLERANCE = 1e-9  # so small, because among many people messages may hardly change for 100 iterations before they do


@compiled
def marginals(misses: Array, pairs: Array, exact_side: int) -> Array:
    """Probabilities (T, N + 1) of no measurement, or of each, from weights of misses (T,) and of pairs (T, N).

    The weight of a matching is the product of its pairs and of the misses of the other tracks. Tracks that share
    measurements, directly or through other tracks, form a cluster. If the smaller side of a cluster is above
    `exact_side`, its probabilities are approximate.
    """
    beta = np.zeros((pairs.shape[0], pairs.shape[1] + 1))
    done = np.zeros(len(pairs), dtype=np.bool_)
    for start in range(len(pairs)):
        if done[start]:
            continue
        rows, columns = _cluster(pairs, start)
        done[rows] = True
        if len(columns) == 0:
            beta[start, 0] = 1.0
            continue
        weights, rest = pairs[rows][:, columns], misses[rows]
        if min(weights.shape) > exact_side:
            matched, free = _propagate(weights, rest)
        elif len(columns) <= len(rows):
            matched, free, _ = _enumerate(weights, rest, np.ones(len(columns)))
        else:
            flipped, _, free = _enumerate(weights.T.copy(), np.ones(len(columns)), rest)
            matched = flipped.T.copy()
        for i in range(len(rows)):
            beta[rows[i], 0] = free[i]
            for j in range(len(columns)):
                beta[rows[i], columns[j] + 1] = matched[i, j]
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
def _enumerate(pairs: Array, row_free: Array, column_free: Array) -> tuple[Array, Array, Array]:
    """Exact marginals over all matchings of rows to columns, by dynamic programming over sets of used columns.

    The weight of a matching is the product of its pairs (R, C), of `row_free` (R,) over the rows and of `column_free`
    (C,) over the columns that it leaves out. Returns the probabilities of pairs, free rows and free columns. The
    forward and backward sums of each row are rescaled, because only their ratios matter.
    """
    rows, columns = pairs.shape
    sets = np.arange(1 << columns)  # of columns, as bits
    without = [sets[sets >> c & 1 == 0] for c in range(columns)]
    forward, backward = [np.zeros(len(sets))], np.ones(len(sets))
    forward[0][0] = 1.0
    for r in range(rows):
        before, after = forward[r], row_free[r] * forward[r]
        for c in range(columns):
            bit, weight = 1 << c, pairs[r, c]
            for used in without[c]:
                after[used | bit] += weight * before[used]
        forward.append(after / after.max())
    for c in range(columns):
        taken = sets >> c & 1
        backward *= taken + (1 - taken) * column_free[c]
    last = forward[rows] * backward
    free_columns = np.array([last[free].sum() for free in without]) / last.sum()
    matched, free_rows = np.empty((rows, columns)), np.empty(rows)
    for r in range(rows - 1, -1, -1):
        sums, before = forward[r], row_free[r] * backward
        free_rows[r] = (sums * before).sum()
        for c in range(columns):
            bit, weight, total = 1 << c, pairs[r, c], 0.0
            for used in without[c]:
                rest = weight * backward[used | bit]
                total += sums[used] * rest
                before[used] += rest
            matched[r, c] = total
        shares, total = matched[r], free_rows[r] + matched[r].sum()
        shares /= total
        free_rows[r] /= total
        backward = before / before.max()
    return matched, free_rows, free_columns


@compiled
def _propagate(pairs: Array, misses: Array) -> tuple[Array, Array]:
    """Marginals of pairs and free rows by loopy belief propagation: exact without cycles. Source: [Williams14].

    The iteration converges from any start. If misses and clutter have little weight, it converges slowly and stops
    earlier: marginals of up to 50 people in a square are then within 0.005 of the limit, or within 0.02 if all people
    are within 4 m and there is hardly any clutter.
    """
    where = np.flatnonzero(pairs)  # one message in each direction for each possible pair
    rows, columns, weights = where // pairs.shape[1], where % pairs.shape[1], pairs.ravel()[where]
    clutter = np.ones(pairs.shape[1])
    by_row = [np.flatnonzero(rows == i) for i in range(len(misses))]
    by_column = [np.flatnonzero(columns == j) for j in range(len(clutter))]
    back, values, sums = np.ones(len(rows)), np.empty(len(rows)), np.empty(len(rows))
    for _ in range(min(_ITERATIONS, _MESSAGES * len(misses) // len(rows))):
        for e in range(len(rows)):
            values[e] = weights[e] * back[e]
        _others(values, misses, by_row, sums)
        for e in range(len(rows)):
            values[e] = weights[e] / sums[e]
        _others(values, clutter, by_column, sums)
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
        shares, total = matched[i], free[i] + matched[i].sum()
        shares /= total
        free[i] /= total
    return matched, free


@compiled
def _others(values: Array, bases: Array, groups: list[Indices], sums: Array) -> None:
    """Set the sum of each value to the base plus all other values of its group, without differences, which cancel.

    groups: indices of the values of group g, which has the base bases[g]; `sums` takes the result.
    """
    for g in range(len(bases)):
        members, left, right = groups[g], bases[g], 0.0
        for k in members:
            sums[k] = 0.0
        for k in range(len(members)):  # both directions at once, so that neither sum waits
            first, last = members[k], members[len(members) - 1 - k]
            sums[first] += left
            left += values[first]
            sums[last] += right
            right += values[last]
