"""Motion model of bounded speed against NCV, Monte Carlo, and the walkers."""

import numpy as np
import pytest

from sim.scenario.environment import Area, People
from sim.world.walkers import walk
from tracking.filter.bounded_speed import BoundedSpeed
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity, update
from tracking.geometry.visibility import Forest

DT, LIMIT = 0.2, 3.0
NCV, BOUNDED = NearlyConstantVelocity(DT, 1.0), BoundedSpeed(DT, 1.0, LIMIT)


def beliefs(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Beliefs with velocities slow and fast, sure and vague."""
    roots = rng.normal(size=(count, 4, 4)) * 10 ** rng.uniform(-1.5, 0.7, (count, 1, 1))
    means = rng.normal(size=(count, 4)) * [20.0, 20.0, 2.0, 2.0]
    return means, roots @ np.swapaxes(roots, 1, 2) + 1e-4 * np.eye(4)


def distance(means: np.ndarray, covariances: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Root mean square distance from a place."""
    spread = np.trace(covariances[:, :2, :2], axis1=1, axis2=2)
    return np.sqrt(np.sum((means[:, :2] - place) ** 2, axis=1) + spread)


def test_beliefs_without_fast_velocities_are_predicted_as_by_ncv_to_the_bit():
    means, covariances = np.array([[5.0, 2.0, 1.5, -1.0], [0.0, 0, 2.0, 0]]), np.tile(0.05 * np.eye(4), (2, 1, 1))
    for ours, plain in zip(BOUNDED.predict_all(means, covariances), NCV.predict_all(means, covariances), strict=True):
        np.testing.assert_array_equal(ours, plain)
    with pytest.raises(ValueError, match=r"max_speed must be positive, is 0.0"):
        BoundedSpeed(DT, 0.5, 0.0)


@pytest.mark.parametrize(("speed", "spread"), [(2.8, 0.3), (3.2, 0.3), (1.0, 1.5), (0.0, 3.0)])
def test_the_moments_are_those_of_people_slowed_down_one_by_one(speed, spread):
    covariance = spread**2 * np.array([[2, 0, 0.6, 0.1], [0, 1, 0, 0.5], [0.6, 0, 1, 0.2], [0.1, 0.5, 0.2, 0.8]])
    mean = np.array([4.0, -3.0, 0.8 * speed, 0.6 * speed])
    people = np.random.default_rng(0).multivariate_normal(mean, covariance, 200_000)
    people[:, 2:] /= np.maximum(np.linalg.norm(people[:, 2:], axis=1) / LIMIT, 1.0)[:, None]
    people = people @ NCV.F.T
    after = BOUNDED.predict(Gaussian(mean, covariance))
    # What 36 samples miss of the jump in slope, to the spread's scale.
    np.testing.assert_allclose(after.mean, people.mean(axis=0), atol=0.06 * spread)
    np.testing.assert_allclose(after.covariance, np.cov(people.T) + NCV.Q, atol=0.06 * spread**2)


def test_a_coasting_track_stays_within_reach_of_its_last_detection():
    """RMS distances in the belief: 3 m/s and the acceleration's own part. Under NCV many of these go further."""
    means, covariances = beliefs(np.random.default_rng(2), 500)
    start = means[:, :2].copy()
    at_start = distance(means, covariances, start)
    free = means, covariances
    for k in range(1, 51):
        means, covariances = BOUNDED.predict_all(means, covariances)
        free = NCV.predict_all(*free)
        allowed = at_start + k * (LIMIT * DT + NCV.sigma_a * DT**2 / np.sqrt(2))
        assert np.all(distance(means, covariances, start) <= allowed)
        assert np.hypot(means[:, 2], means[:, 3]).max() <= LIMIT
        np.testing.assert_array_equal(covariances, np.swapaxes(covariances, 1, 2))
        assert np.linalg.eigvalsh(covariances).min() > 0
    assert np.mean(distance(*free, start) > allowed) > 0.3


def hidden_walkers(model: NearlyConstantVelocity) -> dict[int, tuple[float, float]]:
    """Mean NEES per coordinate, and RMS error [m], of 60 walkers hidden for so many scans after 6 s in view."""
    places = np.concatenate([wanderers(seed) for seed in range(10)], axis=1)
    rng, R, found = np.random.default_rng(0), 0.09 * np.eye(2), {}
    z = places + rng.normal(scale=0.3, size=places.shape)
    means = np.hstack([z[0], np.zeros_like(z[0])])
    covariances = np.tile(np.diag([0.09, 0.09, LIMIT**2 / 4, LIMIT**2 / 4]), (len(means), 1, 1))
    for k in range(1, 81):
        means, covariances = model.predict_all(means, covariances)
        if k <= 30:
            after = [update(Gaussian(m, P), point, R) for m, P, point in zip(means, covariances, z[k], strict=True)]
            means, covariances = np.array([b.mean for b in after]), np.array([b.covariance for b in after])
        elif k - 30 in (5, 10, 25, 50):
            e = means[:, :2] - places[k]
            nees = (e * np.linalg.solve(covariances[:, :2, :2], e[..., None])[..., 0]).sum(axis=1)
            found[k - 30] = float(nees.mean() / 2), float(np.sqrt((e**2).sum(axis=1).mean()))
    return found


def wanderers(seed: int) -> np.ndarray:
    """Positions (81, 6, 2) m of people wandering for 16 s."""
    people = walk(People(count=6, paths=()), Area(), Forest(()), duration=16.2, rng=np.random.default_rng(seed))
    return np.array([people.at(DT * k)[0] for k in range(81)])


def test_beliefs_in_hidden_walkers_are_honest_and_bounded_ones_nearer():
    """Hidden for 1, 2, 5 and 10 s: NEES per coordinate at most 1 with the paper's acceleration of 1 m/s²."""
    free, bounded = hidden_walkers(NCV), hidden_walkers(BOUNDED)
    assert max(nees for nees, _ in free.values()) < 1.0 and max(nees for nees, _ in bounded.values()) < 1.0
    assert all(bounded[k][1] <= free[k][1] for k in free) and bounded[50][1] < 0.95 * free[50][1]
