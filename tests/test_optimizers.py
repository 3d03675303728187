"""The optimiser on functions whose minimum is known."""

import numpy as np
import pytest

from planning.optimizers import CrossEntropy, limited


def test_finds_the_minimum_of_a_quadratic():
    goal = np.array([[1.0, -2.0], [3.0, 0.5], [-1.0, 2.0]])
    best = CrossEntropy(rounds=20).minimise(
        lambda c: np.sum((c - goal) ** 2, axis=(1, 2)), np.zeros((1, 3, 2)), 5.0, np.random.default_rng(0)
    )
    np.testing.assert_allclose(best, goal, atol=0.05)


def test_never_worse_than_its_best_start_and_within_the_speed_limit():
    rng = np.random.default_rng(2)
    for _ in range(20):
        starts = limited(rng.normal(0, 3, (5, 4, 2)), 5.0)
        weights = rng.normal(size=(4, 2))

        def objective(c, weights=weights):
            return np.sin(7 * c @ weights.T).sum(axis=(1, 2)) + np.sum(c * weights, axis=(1, 2))

        best = CrossEntropy(population=8, rounds=2).minimise(objective, starts, 5.0, rng)
        assert objective(best[None])[0] <= objective(starts).min()
        assert np.linalg.norm(best, axis=1).max() <= 5.0 * (1 + 1e-12)


def test_limited_shortens_and_keeps_the_direction():
    plans = limited(np.array([[[6.0, 8.0], [0.3, 0.4]]]), 5.0)
    assert plans[0, 0] == pytest.approx([3.0, 4.0])
    assert plans[0, 1] == pytest.approx([0.3, 0.4])
