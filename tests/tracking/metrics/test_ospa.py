"""OSPA: hand-computed cases and brute force over permutations; `test_gospa.py` has the axioms of a metric."""

import itertools
import math

import numpy as np
import pytest

from tracking.metrics.ospa import ospa

NONE = np.zeros((0, 2))


def random_set(rng: np.random.Generator, most: int = 5) -> np.ndarray:
    return rng.uniform(-60, 60, (rng.integers(0, most + 1), 2))


def brute_force(X: np.ndarray, Y: np.ndarray, c: float, p: float) -> float:
    """Schuhmacher's definition, permutation by permutation."""
    if len(X) > len(Y):
        X, Y = Y, X
    if len(Y) == 0:
        return 0.0
    best = min(
        sum(min(c, math.dist(x, Y[j])) ** p for x, j in zip(X, order, strict=False))
        for order in itertools.permutations(range(len(Y)))
    )
    return ((best + c**p * (len(Y) - len(X))) / len(Y)) ** (1 / p)


@pytest.mark.parametrize(
    ("estimates", "truths", "expected"),
    [
        (NONE, NONE, (0, 0, 0)),
        (NONE, [[1, 2]], (50, 0, 50)),
        ([[1, 2]], NONE, (50, 0, 50)),
        ([[3, 4]], [[0, 0]], (5, 5, 0)),
        ([[300, 400]], [[0, 0]], (50, 50, 0)),
        # Pairs 3 m and 4 m apart, in the other order: sqrt((9 + 16) / 2).
        ([[10, 4], [0, 0]], [[0, 3], [10, 0]], (math.sqrt(12.5), math.sqrt(12.5), 0)),
        # One pair 6 m apart, one missing: sqrt((36 + 2500) / 2).
        ([[6, 0]], [[0, 0], [0, 40]], (math.sqrt(1268), math.sqrt(18), math.sqrt(1250))),
        # All four found within 0 m but one ghost among five: sqrt(2500 / 5).
        (
            [[0, 0], [9, 0], [0, 9], [9, 9], [5, 5]],
            [[9, 9], [0, 9], [9, 0], [0, 0]],
            (math.sqrt(500), 0, math.sqrt(500)),
        ),
    ],
)
def test_ospa_matches_hand_computed_value(estimates, truths, expected):
    np.testing.assert_allclose(ospa(np.array(estimates, float), np.array(truths, float)), expected, rtol=1e-14)


@pytest.mark.parametrize("p", [1.0, 2.0, 3.5])
def test_ospa_matches_brute_force_over_permutations(p):
    rng = np.random.default_rng(0)
    for _ in range(150):
        X, Y, c = random_set(rng), random_set(rng), rng.uniform(1, 100)
        assert ospa(X, Y, c, p).distance == pytest.approx(brute_force(X, Y, c, p), rel=1e-12)


def test_the_parts_make_up_the_distance():
    rng = np.random.default_rng(2)
    for _ in range(100):
        parts = ospa(random_set(rng), random_set(rng), 30.0, 2.0)
        assert parts.distance**2 == pytest.approx(parts.localisation**2 + parts.cardinality**2, rel=1e-12)
