"""Marginal association probabilities of one-to-one matchings: exact, or by loopy belief propagation."""

import numpy as np

from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled, merged

# Enumeration costs (larger side) x (smaller side) x 2^(smaller side) of a cluster. Beyond this side loopy belief
# propagation takes over, so that a scan of fifty people takes less than 5 ms whatever the clusters.
EXACT_SIDE = 10
_ITERATIONS = 1000
_MESSAGES = 10_000  # most messages per track on average: fewer iterations if gates contain more than 10 measurements
_TOLERANCE = 1e-9  # so small, because among many people messages may hardly change for 100 iterations before they do


@merged
def marginals(misses: Array, pairs: Array, exact_side: int) -> Array:
    """Probabilities (T, N + 1) that a track has no measurement, or each, from weights of misses (T,) and pairs (T, N).

    The weight of a matching is the product of its pairs and of the misses of the other tracks. Tracks that share
    measurements, directly or through other tracks, form a cluster. If the smaller side of a cluster is above
    `exact_side`, its probabilities are approximate.
    """
    beta = np.zeros((pairs.shape[0], pairs.shape[1] + 1))
    done = np.zeros(len(pairs), dtype=np.bool_)
    for start in range(len(pairs)):
        if done[start]:
            continue
        if not np.any(pairs[start] > 0.0):  # as of most tracks of a large scene
            beta[start, 0] = 1.0
            continue
        rows, columns = _find_cluster(pairs, start)
        weights, rest = np.empty((len(rows), len(columns))), np.empty(len(rows))
        for i in range(len(rows)):
            done[rows[i]], rest[i] = True, misses[rows[i]]
            for j in range(len(columns)):
                weights[i, j] = pairs[rows[i], columns[j]]
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


@merged
def _find_cluster(pairs: Array, start: int) -> tuple[Indices, Indices]:
    """The cluster of track `start`: its tracks and its measurements, ascending."""
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
    without = _list_sets_without(columns)
    forward, backward, before = _sum_forward(pairs, row_free, without), np.ones(1 << columns), np.empty(1 << columns)
    for c in range(columns):
        for used in without[c]:
            backward[used] *= column_free[c]
    last, free_columns = forward[rows] * backward, np.zeros(columns)
    for c in range(columns):
        for used in without[c]:
            free_columns[c] += last[used]
    matched, free_rows = np.empty((rows, columns)), np.zeros(rows)
    for r in range(rows - 1, -1, -1):
        sums = forward[r]
        for used in range(len(sums)):
            before[used] = row_free[r] * backward[used]
            free_rows[r] += sums[used] * before[used]
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
    return matched, free_rows, free_columns / last.sum()


@merged
def _list_sets_without(columns: int) -> Indices:
    """Sets without each column (C, 2^(C - 1)), ascending, as numbers whose bits are the columns in them."""
    without = np.empty((columns, 1 << columns >> 1), dtype=np.int64)
    for c in range(columns):
        for k in range(without.shape[1]):
            low = k & ((1 << c) - 1)
            without[c, k] = k - low << 1 | low
    return without


@merged
def _sum_forward(pairs: Array, row_free: Array, without: Indices) -> Array:
    """Sums (R + 1, 2^C) of weights over the matchings of the first rows, by the set of columns that they use."""
    sums = np.zeros((len(pairs) + 1, 1 << len(without)))
    sums[0, 0] = 1.0
    for r in range(len(pairs)):
        for used in range(sums.shape[1]):
            sums[r + 1, used] = row_free[r] * sums[r, used]
        for c in range(len(without)):
            bit, weight = 1 << c, pairs[r, c]
            for used in without[c]:
                sums[r + 1, used | bit] += weight * sums[r, used]
        largest = sums[r + 1].max()
        for used in range(sums.shape[1]):
            sums[r + 1, used] /= largest
    return sums


@compiled
def _propagate(pairs: Array, misses: Array) -> tuple[Array, Array]:
    """Marginals of pairs and free rows by loopy belief propagation: exact without cycles. Source: [Williams14].

    The iteration converges from any start. If misses and clutter have little weight, it converges slowly and stops
    earlier: marginals of up to 50 people in a square are then within 0.005 of the limit, or within 0.02 if all people
    are within 4 m and there is hardly any clutter.
    """
    rows, columns = np.nonzero(pairs)  # one message in each direction for each possible pair
    clutter = np.ones(pairs.shape[1])
    by_row, by_column = _group(rows, len(misses)), _group(columns, len(clutter))
    weights, back, values, sums = np.empty(len(rows)), np.ones(len(rows)), np.empty(len(rows)), np.empty(len(rows))
    for e in range(len(rows)):
        weights[e] = pairs[rows[e], columns[e]]
    for _ in range(min(_ITERATIONS, _MESSAGES * len(misses) // len(rows))):
        for e in range(len(rows)):
            values[e] = weights[e] * back[e]
        _sum_others(values, misses, by_row, sums)
        for e in range(len(rows)):
            values[e] = weights[e] / sums[e]
        _sum_others(values, clutter, by_column, sums)
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
def _group(keys: Indices, count: int) -> tuple[Indices, Indices]:
    """Indices of the keys (N,), those of each key from 0 to `count` - 1 together and ascending, and their ends."""
    order, ends, end = np.empty(len(keys), dtype=np.int64), np.empty(count, dtype=np.int64), 0
    for key in range(count):
        for k in range(len(keys)):
            if keys[k] == key:
                order[end] = k
                end += 1
        ends[key] = end
    return order, ends


@compiled
def _sum_others(values: Array, bases: Array, groups: tuple[Indices, Indices], sums: Array) -> None:
    """Set the sum of each value to the base plus all other values of its group, without differences, which cancel.

    groups: as from `_group`, of the values; group g has the base bases[g]; `sums` takes the result.
    """
    order, ends = groups
    for g in range(len(bases)):
        members, left, right = order[(ends[g - 1] if g else 0) : ends[g]], bases[g], 0.0
        for k in members:
            sums[k] = 0.0
        for k in range(len(members)):  # both directions at once, so that neither sum waits
            first, last = members[k], members[len(members) - 1 - k]
            sums[first] += left
            left += values[first]
            sums[last] += right
            right += values[last]
