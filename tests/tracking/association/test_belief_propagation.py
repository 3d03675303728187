"""Error of loopy belief propagation on clusters beyond the stated size, against exact probabilities."""

import numpy as np
import pytest

from tracking.association.jpda import gated_likelihood
from tracking.association.marginals import marginals

LARGEST = 12  # people of fully enumerated clusters, two more than in the tracker
DEVIATION = 0.3  # m, of predictions and of measurements


def crowd(rng: np.random.Generator, people: int, apart: float, detection: float, clutter: float):
    """Weights of misses and pairs among people about `apart` m from each other in a square, all rows in range."""
    side = int(np.ceil(np.sqrt(people)))
    places = apart * np.array([divmod(k, side) for k in range(people)], dtype=float)
    means = np.column_stack([places + rng.normal(0, DEVIATION, (people, 2)), np.zeros((people, 2))])
    z = places[rng.random(people) < detection]
    z = z + rng.normal(0, DEVIATION, z.shape)
    spread = DEVIATION**2 * np.eye(4)
    noise = np.tile(spread[:2, :2], (len(z), 1, 1))
    likelihood = gated_likelihood(means, np.tile(spread, (people, 1, 1)), z, noise, 0.9999)
    misses, pairs = np.full(people, 1 - detection * 0.9999), detection * 0.9999 * likelihood / clutter
    scale = np.maximum(misses, pairs.max(axis=1, initial=0.0))
    return misses / scale, pairs / scale[:, None]


@pytest.mark.parametrize(
    ("apart", "detection", "clutter", "worst", "usual"),
    [
        # Five deviations of a difference between neighbours: hardly a cycle.
        (2.1, 0.9, 0.01, 0.02, 0.0001),
        # Gates overlap, and false alarms explain what tracks do not.
        (1.0, 0.9, 0.01, 0.35, 0.06),
        (0.5, 0.9, 0.01, 0.35, 0.04),
        # Nearly every measurement must be a person's: few matchings count, and propagation is too sure of one.
        (1.0, 0.99, 1e-6, 0.50, 0.12),
        (0.5, 0.99, 1e-6, 0.50, 0.05),
    ],
)
def test_belief_propagation_is_within_bounds_of_exact(apart, detection, clutter, worst, usual):
    """`worst`: any probability of 2 to 12 people; `usual`: the largest of a track's, on average."""
    rng = np.random.default_rng(0)
    errors = []
    for people in range(2, LARGEST + 1):
        for _ in range(4):
            weights = crowd(rng, people, apart, detection, clutter)
            exact, approximate = marginals(*weights, LARGEST), marginals(*weights, 0)
            np.testing.assert_allclose(approximate.sum(axis=1), 1, rtol=1e-12)
            errors.append(np.abs(approximate - exact).max(axis=1))
    each = np.concatenate(errors)
    print(f"\n{apart} m apart, P_D {detection}, clutter {clutter}: worst {each.max():.3f}, usual {each.mean():.4f}")
    assert each.max() <= worst and each.mean() <= usual


@pytest.mark.parametrize("people", [12, 40])
@pytest.mark.parametrize("clutter", [1e-2, 1e-6])
def test_belief_propagation_ends_near_its_fixed_point(people, clutter):
    """The limit on iterations costs little where convergence is slow."""
    rng = np.random.default_rng(people)
    for apart in (0.4, 0.8):
        misses, pairs = crowd(rng, people, apart, 0.9, clutter)
        back = np.ones_like(pairs)
        for _ in range(4_000):
            weighed = pairs * back
            there = pairs / (misses[:, None] + weighed.sum(axis=1, keepdims=True) - weighed)
            back = 1 / (1 + there.sum(axis=0, keepdims=True) - there)
        matched = pairs * back
        fixed = matched / (misses + matched.sum(axis=1))[:, None]
        np.testing.assert_allclose(marginals(misses, pairs, 0)[:, 1:], fixed, atol=3e-3)
