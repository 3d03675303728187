"""Beliefs after a scan without a detection, against closed forms and sampling."""

import math

import numpy as np
import pytest
from scenes import ABOVE, CAMERA, MOTION, play, scan, track, tracker
from scipy import stats

from tracking.absence import given_undetected
from tracking.visibility import SAMPLE_VARIANCE, SAMPLES, TARGET_HEIGHT, Forest, Tree


def belief(rng):
    root = rng.normal(size=(4, 4))
    return rng.normal(0, 5, 4), root @ root.T + 0.1 * np.eye(4)


def seen_where(condition, mean, covariance):
    """At which sample positions a person would be seen, if that is where `condition` holds."""
    return condition(mean[:2] + SAMPLES @ np.linalg.cholesky(covariance[:2, :2]).T)


def test_the_samples_stand_for_a_standard_normal_distribution():
    np.testing.assert_allclose(SAMPLES.mean(axis=0), 0, atol=1e-15)
    second = SAMPLES.T @ SAMPLES / len(SAMPLES) + SAMPLE_VARIANCE * np.eye(2)
    np.testing.assert_allclose(second, np.eye(2), atol=1e-14)
    assert np.mean(np.abs(SAMPLES[:, 0])) == pytest.approx(math.sqrt(2 / math.pi), rel=1e-12)


@pytest.mark.parametrize("value", [False, True])
def test_nothing_is_learnt_where_all_or_nothing_would_have_been_seen(value):
    mean, covariance = belief(np.random.default_rng(0))
    seen = np.full((1, len(SAMPLES)), value)
    means, covariances = given_undetected((mean[None], covariance[None]), seen, 0.99, 1.0)
    np.testing.assert_array_equal(means[0], mean)
    np.testing.assert_array_equal(covariances[0], covariance)


def test_an_edge_through_the_mean_leaves_the_moments_of_half_a_normal_distribution():
    covariance = np.diag([4.0, 1.0, 1.0, 1.0])
    covariance[0, 2] = covariance[2, 0] = 1.2
    mean = np.array([3.0, 0.0, 1.0, 0.5])
    seen = seen_where(lambda p: p[:, 0] > 3.0, mean, covariance)
    means, covariances = given_undetected((mean[None], covariance[None]), seen[None], 1 - 1e-12, 1.0)
    half = stats.halfnorm()
    shift = -half.mean()
    assert means[0, 0] - 3.0 == pytest.approx(2 * shift, rel=1e-9)
    assert covariances[0, 0, 0] == pytest.approx(4 * half.var(), rel=1e-9)
    # What is correlated with the position follows by regression: slope 1.2 / 4.
    assert means[0, 2] - 1.0 == pytest.approx(0.3 * (means[0, 0] - 3.0), rel=1e-9)
    assert covariances[0, 2, 2] == pytest.approx(1 - 0.09 * (4 - covariances[0, 0, 0]), rel=1e-9)
    assert means[0, 1] == pytest.approx(0.0, abs=1e-12) and covariances[0, 1, 1] == pytest.approx(1.0, rel=1e-9)


def test_random_half_planes_give_the_moments_of_weighted_samples():
    rng = np.random.default_rng(3)
    for _ in range(20):
        mean, covariance = belief(rng)
        angle, offset = rng.uniform(0, 2 * math.pi), rng.uniform(-0.6, 0.6)
        normal = np.array([math.cos(angle), math.sin(angle)])
        scale = math.sqrt(normal @ covariance[:2, :2] @ normal)

        def visible(p, mean=mean, normal=normal, limit=offset * scale):
            return (p - mean[:2]) @ normal > limit

        means, covariances = given_undetected(
            (mean[None], covariance[None]), seen_where(visible, mean, covariance)[None], 0.9, 1.0
        )
        states = rng.multivariate_normal(mean, covariance, 100_000)
        weights = 1 - 0.9 * visible(states[:, :2])
        expected = np.average(states, axis=0, weights=weights)
        spread = np.cov(states.T, aweights=weights)
        sigma = np.sqrt(np.diag(covariance))
        assert np.all(np.abs(means[0] - expected) < 0.2 * sigma)
        assert np.all(np.abs(np.sqrt(np.diag(covariances[0])) - np.sqrt(np.diag(spread))) < 0.15 * sigma)


def test_covariances_stay_positive_definite_and_never_grow_for_many_scans_of_the_same_empty_place():
    mean, covariance = np.zeros(4), np.diag([4.0, 4.0, 1.0, 1.0])
    means, covariances = mean[None], covariance[None]
    for _ in range(200):
        seen = seen_where(lambda p: np.hypot(*(p - 1.0).T) > 1.5, means[0], covariances[0])
        before = np.trace(covariances[0])
        means, covariances = given_undetected((means, covariances), seen[None], 0.99, 1.0)
        assert np.linalg.eigvalsh(covariances[0]).min() > 0
        assert np.trace(covariances[0]) <= before * (1 + 1e-9)
    assert np.hypot(*(means[0, :2] - 1.0)) < 1.5


def test_a_weight_tempers_the_likelihood_and_zero_turns_it_off():
    mean, covariance = belief(np.random.default_rng(4))
    seen = seen_where(lambda p: p[:, 0] > mean[0], mean, covariance)[None]
    predicted = mean[None], covariance[None]
    off, half, full = (given_undetected(predicted, seen, 0.99, w)[0][0, 0] for w in (0.0, 0.5, 1.0))
    assert off == pytest.approx(mean[0], rel=1e-12)
    # Half the mass is seen: with the likelihood l there, the mean moves by (1 - l) / (1 + l) of the full shift.
    tempered, plain = (1 - 0.1) / (1 + 0.1), (1 - 0.01) / (1 + 0.01)
    assert (half - mean[0]) / (full - mean[0]) == pytest.approx(tempered / plain, rel=1e-9)


TREE = Forest((Tree(0.0, 0.0, 5.0),))
INSTANTS = (25, 35, 50, 65)  # scans: 5 to 13 s


def true_posterior(count: int = 40_000) -> tuple[np.ndarray, np.ndarray]:
    """Means and deviations (4, 4), at `INSTANTS`, of who walks under the tree and is not seen, by a particle filter."""
    rng = np.random.default_rng(5)
    kick, out = MOTION.sigma_a * np.kron([[MOTION.dt**2 / 2], [MOTION.dt]], np.eye(2)), []
    x = rng.multivariate_normal([-1.0, 0.0, 1.5, 0.0], 0.05 * np.eye(4), count)
    for k in range(INSTANTS[-1] + 1):
        if k:
            x = x @ MOTION.F.T + rng.normal(size=(count, 2)) @ kick.T
        points = np.column_stack([x[:, :2], np.full(count, TARGET_HEIGHT)])
        weights = 1.0 - 0.99 * (CAMERA.sees(ABOVE, points) & TREE.visible(ABOVE.position, points)[0])
        x = x[rng.choice(count, count, p=weights / weights.sum())]
        if k in INSTANTS:
            out.append((x.mean(axis=0), x.std(axis=0)))
    means, deviations = zip(*out, strict=True)
    return np.array(means), np.array(deviations)


def believed(weight: float) -> tuple[np.ndarray, np.ndarray]:
    """The same of a tracker."""
    subject = tracker(track(3, -1, 0, 1.5, 0), forest=TREE, absence_weight=weight, delete=(60, 60))
    out = []
    for k in range(INSTANTS[-1] + 1):
        play(subject, [scan(k)])
        if k in INSTANTS:
            belief = subject.tracks[0].belief
            out.append((belief.mean, np.sqrt(np.diag(belief.covariance))))
    means, deviations = zip(*out, strict=True)
    return np.array(means), np.array(deviations)


def test_who_does_not_come_out_is_believed_where_particles_are_and_as_surely():
    """About as wide, and off by a fraction of that; with the default weight narrower, and far off with none."""
    means, deviations = true_posterior()
    found, widths = believed(0.1)
    assert np.max(np.abs(found - means) / deviations) < 0.4
    assert 0.7 < np.min(widths / deviations) and np.max(widths / deviations) < 1.3
    sure, wide = believed(0.3)[1] / deviations, np.abs(believed(0.0)[0] - means) / deviations
    assert 0.4 < np.min(sure) < 0.7 and np.max(sure) < 1.1
    assert np.max(wide) > 2.0
