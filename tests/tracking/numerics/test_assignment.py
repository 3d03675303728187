"""Assignments against enumeration."""

from itertools import combinations, permutations

import numpy as np
import pytest

from tracking.numerics.assignment import least_costs, most_pairs, pairs_within

_SHAPES = pytest.mark.parametrize("shape", [(0, 3), (1, 1), (2, 4), (4, 3)])


def _matchings(rows, columns):
    """Sets of pairs of rows and columns, each in one pair at most."""
    for size in range(min(rows, columns) + 1):
        for chosen in combinations(range(rows), size):
            for partners in permutations(range(columns), size):
                yield list(zip(chosen, partners, strict=True))


def _total(cost, pairs):
    return sum(cost[pair] for pair in pairs)


@_SHAPES
def test_most_pairs_are_as_many_as_allowed_at_the_least_cost(shape):
    rng = np.random.default_rng(shape)
    for _ in range(20):
        cost, allowed = rng.normal(0.0, 5.0, shape), rng.random(shape) < 0.5
        cost[rng.random(shape) < 0.1] = np.nan
        able = allowed & np.isfinite(cost)
        sets = [pairs for pairs in _matchings(*shape) if all(able[pair] for pair in pairs)]
        best = min(sets, key=lambda pairs: (-len(pairs), _total(cost, pairs)))
        found = most_pairs(allowed, cost)
        assert all(able[pair] for pair in found)
        assert (len(found), _total(cost, found)) == pytest.approx((len(best), _total(cost, best)))


@_SHAPES
def test_pairs_within_a_gate_cost_least_if_each_one_left_over_costs_the_gate(shape):
    rng = np.random.default_rng(shape)
    for _ in range(20):
        cost, gate = rng.exponential(2.0, shape), 2.0
        gain = max(sum(gate - cost[pair] for pair in pairs) for pairs in _matchings(*shape))
        found = pairs_within(cost, gate)
        assert all(cost[pair] <= gate for pair in found)
        assert sum(gate - cost[pair] for pair in found) == pytest.approx(gain)
        full = [pairs for pairs in _matchings(*shape) if len(pairs) == min(shape)]
        assert least_costs(cost).sum() == pytest.approx(min(_total(cost, pairs) for pairs in full))
