"""NEES: its value, and a filter on its own model."""

import numpy as np
import pytest
from helpers.kalman import update
from scipy.stats import chi2

from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
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


def test_a_kalman_filter_is_consistent_on_its_own_model_but_not_overconfident():
    """400 targets with one error each, after 25 steps: errors of different targets are independent."""
    rng = np.random.default_rng(2)
    motion = NearlyConstantVelocity(0.2, 1.0)
    R, start = np.diag([0.3, 0.1]), np.diag([1.0, 1.0, 0.5, 0.5])
    Q = np.linalg.svd(motion.Q)
    errors, covariances = [], []
    for _ in range(400):
        truth = rng.normal(0, np.sqrt(np.diag(start)))
        belief = Gaussian(np.zeros(4), start)
        for _ in range(25):
            truth = motion.F @ truth + Q[0] @ (np.sqrt(Q[1]) * rng.normal(size=4))
            z = truth[:2] + rng.normal(0, np.sqrt(np.diag(R)))
            belief = update(motion.predict(belief), z, R)
        errors.append(belief.mean - truth)
        covariances.append(belief.covariance)
    errors, covariances = np.array(errors), np.array(covariances)
    for dof in (2, 4):
        low, high = nees_interval(400, dof)
        assert low <= squared_distance(errors[:, :dof], covariances[:, :dof, :dof]).mean() <= high
        assert squared_distance(errors[:, :dof], 0.7 * covariances[:, :dof, :dof]).mean() > high
