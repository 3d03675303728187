"""NEES: its value, and a filter on its own model."""

import numpy as np
import pytest
from scipy.stats import chi2

from tracking.metrics.nees import nees_interval
from tracking.numerics.distances import squared_distance


def test_nees_equals_a_direct_loop():
    rng = np.random.default_rng(0)
    roots = rng.normal(size=(5, 7, 4, 4))
    P, e = roots @ np.swapaxes(roots, -1, -2) + 0.1 * np.eye(4), rng.normal(size=(5, 7, 4))
    expected = [[e[i, j] @ np.linalg.inv(P[i, j]) @ e[i, j] for j in range(7)] for i in range(5)]
    np.testing.assert_allclose(squared_distance(e, P), expected, rtol=1e-10)
    assert squared_distance(np.zeros((0, 2)), np.zeros((0, 2, 2))).shape == (0,)


def test_the_interval_holds_95_percent_of_means():
    low, high = nees_interval(20, 4)
    means = np.random.default_rng(1).chisquare(4, (20_000, 20)).mean(axis=1)
    assert np.mean((means >= low) & (means <= high)) == pytest.approx(0.95, abs=0.005)
    assert nees_interval(1, 2) == pytest.approx(tuple(chi2.interval(0.95, 2)))
    with pytest.raises(ValueError, match="at least 1"):
        nees_interval(0, 2)
