"""Beliefs after a scan without a detection, against closed forms and sampling."""

import math
from functools import cache

import numpy as np
import pytest
from helpers.particles import hidden, start
from helpers.scenes import ABOVE, CAMERA, MOTION, play, scan, track, tracker
from scipy import stats

from tracking.filter.negative_information import miss_likelihood, negative_information_update
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import SAMPLE_VARIANCE, SAMPLES, Forest, Tree, visible_samples
from tracking.measurement_update import predict_scan
from tracking.parameters import TrackerParameters
from tracking.track import Beliefs, Scan

INSTANTS = (10, 25, 35, 50, 65)  # scans: 2 to 13 s
UNDER_TREES = [(1.0, 1.5), (2.0, 1.5), (2.0, 0.5), (5.0, 0.7), (5.0, 1.5), (8.0, 1.5)]


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
def test_full_or_no_visibility_gives_no_negative_information(value):
    mean, covariance = belief(np.random.default_rng(0))
    seen = np.full((1, len(SAMPLES)), value)
    means, covariances = negative_information_update(mean[None], covariance[None], 1 - 0.99 * seen)
    np.testing.assert_array_equal(means[0], mean)
    np.testing.assert_array_equal(covariances[0], covariance)


def test_an_edge_through_the_mean_leaves_the_moments_of_half_a_normal_distribution():
    covariance = np.diag([4.0, 1.0, 1.0, 1.0])
    covariance[0, 2] = covariance[2, 0] = 1.2
    mean = np.array([3.0, 0.0, 1.0, 0.5])
    seen = seen_where(lambda p: p[:, 0] > 3.0, mean, covariance)
    means, covariances = negative_information_update(mean[None], covariance[None], 1 - (1 - 1e-12) * seen[None])
    half = stats.halfnorm()
    shift = -half.mean()
    assert means[0, 0] - 3.0 == pytest.approx(2 * shift, rel=1e-9)
    assert covariances[0, 0, 0] == pytest.approx(4 * half.var(), rel=1e-9)
    # What is correlated with the position follows by regression: slope 1.2 / 4.
    assert means[0, 2] - 1.0 == pytest.approx(0.3 * (means[0, 0] - 3.0), rel=1e-9)
    assert covariances[0, 2, 2] == pytest.approx(1 - 0.09 * (4 - covariances[0, 0, 0]), rel=1e-9)
    assert means[0, 1] == pytest.approx(0.0, abs=1e-12) and covariances[0, 1, 1] == pytest.approx(1.0, rel=1e-9)


def test_a_weight_tempers_the_likelihood_and_zero_turns_it_off():
    mean, covariance = belief(np.random.default_rng(4))
    seen = seen_where(lambda p: p[:, 0] > mean[0], mean, covariance)[None]
    predicted, whose = Beliefs(mean[None], covariance[None]), np.array([0, 1])

    def undetected(weight):
        p = TrackerParameters(MOTION, negative_information=weight)
        before = predict_scan(predicted, np.ones(1), seen.mean(axis=1), 1 - 0.99 * seen, p.scan, whose)
        return before.undetected.means[0, 0]

    off, half, full = undetected(0.0), undetected(0.5), undetected(1.0)
    assert off == pytest.approx(mean[0], rel=1e-12)
    # Half the mass is seen: with the likelihood l there, the mean moves by (1 - l) / (1 + l) of the full shift.
    tempered, plain = (1 - 0.1) / (1 + 0.1), (1 - 0.01) / (1 + 0.01)
    assert (half - mean[0]) / (full - mean[0]) == pytest.approx(tempered / plain, rel=1e-9)


@cache
def true_posterior(radius: float, speed: float, detection: float = 0.99) -> tuple[np.ndarray, np.ndarray]:
    """Means and deviations, at `INSTANTS`, of a person hidden under the tree, by a particle filter.

    20 000 particles err by less than a tenth of a deviation; the bounds below are 0.8 of one and more.
    """
    states = list(hidden(radius, speed, [ABOVE], INSTANTS[-1] + 1, detection))
    return np.array([states[k].mean(axis=0) for k in INSTANTS]), np.array([states[k].std(axis=0) for k in INSTANTS])


def believed(radius: float, speed: float, every: int = 1, **settings) -> tuple[np.ndarray, np.ndarray]:
    """The same of a tracker that has a frame in some of the scans."""
    known, tree = track(3, *start(radius, speed), variance=0.05), Forest((Tree(0.0, 0.0, radius),))
    subject, out = tracker(known, forest=tree, delete=(60, 60), management="m_of_n", **settings), []
    for k in range(INSTANTS[-1] + 1):
        if k % every == 0:
            play(subject, [scan(k)])
        if k in INSTANTS:
            belief = subject.tracks[0].belief
            out.append((belief.mean, np.sqrt(np.diag(belief.covariance))))
    means, deviations = zip(*out, strict=True)
    return np.array(means), np.array(deviations)


@pytest.mark.parametrize(("radius", "speed"), UNDER_TREES)
def test_the_belief_in_a_hidden_person_agrees_with_a_particle_filter(radius, speed):
    """About as wide and, for the width, not far off, under small and large canopies; not so without this evidence."""
    means, deviations = true_posterior(radius, speed)
    found, widths = believed(radius, speed)
    assert np.max(np.abs(found - means) / deviations) < 0.8
    assert 0.7 < np.min(widths / deviations) and np.max(widths / deviations) < 1.5
    if radius < 8.0:  # from under which it takes longer to come out than this
        found, widths = believed(radius, speed, negative_information=0.0)
        assert np.max(np.abs(found - means) / deviations) > 2.0 and np.max(widths / deviations) > 2.0


@pytest.mark.parametrize(("radius", "speed"), UNDER_TREES[1:])
def test_fewer_frames_give_as_much_negative_information(radius, speed):
    """One a second instead of five; out of the smallest canopy people come between two of them."""
    means, deviations = true_posterior(radius, speed)
    found, widths = believed(radius, speed, every=5)
    assert np.max(np.abs(found - means) / deviations) < 0.75
    assert 0.5 < np.min(widths / deviations) and np.max(widths / deviations) < 1.5


@pytest.mark.parametrize("detection", [0.7, 0.9, 0.999])
def test_negative_information_hardly_depends_on_the_detection_probability(detection):
    """A second frame of a place tells only of people that came meanwhile, at any probability of detection."""
    for radius, speed in UNDER_TREES[1:4]:
        means, deviations = true_posterior(radius, speed, detection)
        found, widths = believed(radius, speed, detection_probability=detection)
        assert np.max(np.abs(found - means) / deviations) < 0.8
        assert 0.7 < np.min(widths / deviations) and np.max(widths / deviations) < 1.4


def test_a_frame_counts_in_full_beyond_the_last_frames_view():
    tree = Forest((Tree(3.0, 0.0, 3.0),))
    beliefs = np.zeros((1, 4)), np.diag([4.0, 4.0, 1.0, 1.0])[None]
    beside = Pose.level(0.0, 10.5, 20.0)  # its view ends within the belief
    points = np.column_stack([2.0 * SAMPLES, np.full(len(SAMPLES), TARGET_HEIGHT)])
    there, before = (CAMERA.sees(p, points) & tree.visible(p.position, points)[0] for p in (ABOVE, beside))
    assert (there & before).any() and (there & ~before).any()

    def looked(time, last):
        views = visible_samples(tree, *beliefs, CAMERA.lens(ABOVE), last)
        return views[:, 0], miss_likelihood(*beliefs, views, np.array([time - 1.0]), 0.9)

    seen, missed = looked(1.2, CAMERA.lens(beside))
    np.testing.assert_array_equal(seen[0], there)
    again = math.exp(-8.5 * 0.2 * math.sqrt(2 / 8))
    np.testing.assert_allclose(missed[0], np.where(there, np.where(before, again, 0.1), 1.0), rtol=1e-12)
    late, first = looked(9.0, CAMERA.lens(beside))[1], looked(9.0, None)[1]
    np.testing.assert_allclose(late[0], np.where(there, 0.1, 1.0), rtol=1e-12)
    np.testing.assert_array_equal(first, late)


def test_the_first_frame_of_a_place_counts_in_full():
    """From then on only what may have come there since does: a look at once says nothing."""
    tree, known = Forest((Tree(3.0, 0.0, 3.0),)), track(3, 0.0, 0.0, 1.0, 0.0, variance=1.0)
    first, often = (tracker(known, forest=tree) for _ in range(2))
    play(first, [scan(0)])
    play(often, [Scan(0, 1e-5 * k, ABOVE, np.zeros((0, 2)), np.zeros((0, 2, 2))) for k in range(20)])
    assert first.tracks[0].belief.mean[0] > 0.2
    np.testing.assert_allclose(often.tracks[0].belief.mean, first.tracks[0].belief.mean, atol=1e-3)
