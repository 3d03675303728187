"""Association where the answer is known; gates and the mixture update against their definitions."""

import itertools
import math

import numpy as np
import pytest
from helpers.kalman import update

from tracking.association.jpda import existence_association, gated_likelihood, mixture_update
from tracking.association.marginals import EXACT_SIDE, marginals
from tracking.filter.kalman import Gaussian


def associated(likelihood):
    """Probabilities of as many people, who exist for certain, as measurements."""
    size = len(likelihood)
    return existence_association(likelihood, np.full((size, size + 1), 0.9), 0.01, np.ones(size))[0]


def test_probabilities_are_exact_up_to_the_stated_size_and_sum_to_one_beyond():
    rng = np.random.default_rng(4)
    for size in (EXACT_SIDE, EXACT_SIDE + 1, 40):
        beta = associated(rng.random((size, size)))
        np.testing.assert_allclose(beta.sum(axis=1), 1, rtol=1e-12)
        assert beta.min() >= 0 and beta[:, 1:].sum(axis=0).max() < 1 + (1e-12 if size <= EXACT_SIDE else 0.05)
    # All tracks alike and all measurements alike: by symmetry each row is the same, exact or not.
    alike = associated(np.ones((20, 20)))
    np.testing.assert_allclose(alike, np.tile(alike[0], (20, 1)), rtol=1e-9)


def test_belief_propagation_is_exact_on_trees():
    rng = np.random.default_rng(5)
    for _ in range(100):
        tracks, measurements = 6, 7
        linked = np.zeros((tracks, measurements), bool)
        reached_rows, reached_columns = [0], []
        for node in rng.permutation(np.arange(1, tracks + measurements)).tolist():
            # Each new node hangs on one node of the other kind, so that no cycle can arise.
            if node < tracks and reached_columns:
                linked[node, rng.choice(reached_columns)] = True
                reached_rows.append(node)
            elif node >= tracks:
                linked[rng.choice(reached_rows), node - tracks] = True
                reached_columns.append(node - tracks)
        # Likelihoods over four decades, and probabilities of detection of which a third is zero.
        likelihood = linked * 10 ** rng.uniform(-4, 0, (tracks, measurements))
        detection = rng.random(tracks) * (rng.random(tracks) < 2 / 3)
        parts = 1 - detection, detection[:, None] * likelihood / 10 ** rng.uniform(-5, 0)
        np.testing.assert_allclose(marginals(*parts, 0), marginals(*parts, 12), rtol=1e-8, atol=1e-14)


def random_scene(rng: np.random.Generator, T: int, N: int):
    roots, noise = rng.normal(size=(T, 4, 4)), rng.normal(size=(N, 2, 2))
    covariances = roots @ np.swapaxes(roots, 1, 2) + 0.1 * np.eye(4)
    return (
        rng.normal(scale=3, size=(T, 4)),
        covariances,
        rng.normal(scale=3, size=(N, 2)),
        noise @ np.swapaxes(noise, 1, 2) + 0.1 * np.eye(2),
    )


def test_likelihoods_are_the_innovations_density():
    rng = np.random.default_rng(8)
    means, covariances, z, noise = random_scene(rng, 4, 5)
    likelihood = gated_likelihood(means, covariances, z, noise, 0.95)
    for i, j in itertools.product(range(4), range(5)):
        S, nu = covariances[i, :2, :2] + noise[j], z[j] - means[i, :2]
        d2 = nu @ np.linalg.solve(S, nu)
        density = math.exp(-d2 / 2) / math.sqrt(np.linalg.det(2 * math.pi * S)) / 0.95
        assert likelihood[i, j] == pytest.approx(density if d2 <= -2 * math.log(0.05) else 0, rel=1e-10)
    assert 0 < np.count_nonzero(likelihood) < 20


def test_the_mixture_update_has_the_moments_of_the_mixture():
    rng = np.random.default_rng(9)
    for k in range(30):
        means, covariances, z, noise = random_scene(rng, 3, 4)
        beta = rng.dirichlet(np.ones(5), 3) if k else np.eye(5)[[0, 1, 4]]  # at first, all is certain
        undetected = means + rng.normal(0, 0.3, means.shape), 0.7 * covariances
        new_means, new_covariances = mixture_update((means, covariances), undetected, z, noise, beta)
        for i in range(3):
            predicted = Gaussian(means[i], covariances[i])
            parts = [Gaussian(undetected[0][i], undetected[1][i])]
            parts += [update(predicted, z[j], noise[j]) for j in range(4)]
            mean = sum(b * p.mean for b, p in zip(beta[i], parts, strict=True))
            second = sum(b * (p.covariance + np.outer(p.mean, p.mean)) for b, p in zip(beta[i], parts, strict=True))
            np.testing.assert_allclose(new_means[i], mean, rtol=1e-9, atol=1e-11)
            np.testing.assert_allclose(new_covariances[i], second - np.outer(mean, mean), rtol=1e-8, atol=1e-9)
            np.testing.assert_array_equal(new_covariances[i], new_covariances[i].T)
            assert np.linalg.eigvalsh(new_covariances[i]).min() > 0
