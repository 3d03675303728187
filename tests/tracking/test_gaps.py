"""Scans at uneven times: prediction by the true gap, long gaps, and probabilities that reach zero."""

import numpy as np
import pytest
from helpers.scenes import ABOVE, ALONE, OPEN

from tracking.association.jpda import existence_association
from tracking.association.marginals import EXACT_SIDE
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.filter.mean_reverting import MeanRevertingVelocity
from tracking.filter.motion import count_steps, predict_steps
from tracking.fusion.consensus import fuse
from tracking.geometry.camera import ALL_ROUND, Camera
from tracking.metrics.nees import nees_interval
from tracking.parameters import TrackerParameters
from tracking.track import Scan, Track
from tracking.tracker import Tracker
from tracking.undetected import UndetectedIntensity

DT, SIGMA, NOISE = 0.2, 0.75, 0.02 * np.eye(2)
NCV = NearlyConstantVelocity(DT, SIGMA)
WALKING = MeanRevertingVelocity(DT, SIGMA, walking_speed=1.75)
MODELS = pytest.mark.parametrize("model", [NCV, WALKING], ids=["ncv", "mean-reverting"])
MEANS = np.array([[3.0, 1.0, -2.0, 0.5], [0.0, 0.0, 0.0, 0.0]])
COVARIANCES = np.stack([np.diag([0.3, 0.2, 0.4, 0.1]) + 0.05, np.eye(4)])


class Minimal:
    """As docs/how-to/plugins.md asks: `dt` and `predict_all` alone."""

    def __init__(self, model: NearlyConstantVelocity = NCV) -> None:
        self.dt, self._model = model.dt, model

    def predict_all(self, means, covariances):
        return self._model.predict_all(means, covariances)


def tracker(model, *initial: Track, **settings) -> Tracker:
    return Tracker(0, Camera(ALL_ROUND, 128), TrackerParameters(model, **settings), initial)


def step(subject: Tracker, now: float, *points) -> None:
    z = np.array(points, float).reshape(-1, 2)
    subject.step(Scan(0, now, ABOVE, z, np.tile(NOISE, (len(z), 1, 1))))
    fuse([subject], ALONE, 5)


def one_by_one(model, steps: int):
    means, covariances = MEANS, COVARIANCES
    for _ in range(steps):
        means, covariances = model.predict_all(means, covariances)
    return means, covariances


@MODELS
@pytest.mark.parametrize("steps", [1, 10, 1000, 1001, 5000])
def test_many_steps_at_once_are_as_many_steps(model, steps):
    expected = one_by_one(model, steps)
    found = predict_steps(model, MEANS, COVARIANCES, steps)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
    at_once = model.stretch(steps * DT).predict_all(MEANS, COVARIANCES)
    np.testing.assert_allclose(at_once[1], expected[1], rtol=1e-9, atol=1e-9)


@MODELS
def test_parts_of_a_step_add_up_to_it_and_noise_grows_with_time(model):
    """Over parts the mean moves as over the whole; the variance of velocities grows by σ² dt per second."""
    still = np.zeros((1, 4)), np.zeros((1, 4, 4))
    for duration in (0.01, 0.07, 0.31, 0.5):
        _, spread = model.stretch(duration).predict_all(*still)
        assert spread[0, 2, 2] == pytest.approx(SIGMA**2 * DT * duration, rel=0.2 if model is WALKING else 1e-12)
        moved, _ = model.stretch(duration).predict_all(MEANS, 1e-9 * COVARIANCES)
        np.testing.assert_allclose(moved[0, :2], MEANS[0, :2] + duration * MEANS[0, 2:], atol=0.05)
    means, covariances = MEANS, COVARIANCES
    for part in (0.05, 0.12, 0.03):
        means, covariances = model.stretch(part).predict_all(means, covariances)
    whole = model.predict_all(MEANS, COVARIANCES)
    np.testing.assert_allclose(means, whole[0], atol=2e-3)
    np.testing.assert_allclose(covariances, whole[1], atol=2e-3)


@MODELS
def test_whole_steps_keep_their_bits(model, monkeypatch):
    """Gaps of missions are multiples of dt, however their times are rounded."""
    monkeypatch.setattr(type(model), "stretch", lambda *_: pytest.fail("a whole number of steps was stretched"))
    subject = tracker(model, Track(0, Gaussian(MEANS[0], COVARIANCES[0])), survival=1.0, max_variance=1e8)
    count = 0
    step(subject, 7.1, MEANS[0, :2])
    for gap in (1, 2, 1, 1000, 3, 1):
        (before,) = subject.tracks
        count += gap
        subject.coast(7.1 + 0.1 * (2 * count) + 1e-9)
        (after,) = subject.tracks
        means, covariances = before.belief.mean[None], before.belief.covariance[None]
        for _ in range(gap):
            means, covariances = subject.motion.predict_all(means, covariances)
        assert np.array_equal(after.belief.mean, means[0]) and np.array_equal(after.belief.covariance, covariances[0])
        fuse([subject], ALONE, 5)


def test_steps_are_whole_where_a_model_has_no_others():
    assert [count_steps(Minimal(), t) for t in (0.29, 0.31, 0.2)] == [1.0, 2.0, 1.0]
    assert [count_steps(NCV, t) for t in (0.2, 0.20001, 0.1 + 0.2)] == [1.0, 1.0, pytest.approx(1.5)]
    for found, expected in zip(predict_steps(Minimal(), MEANS, COVARIANCES, 30.0), one_by_one(NCV, 30), strict=True):
        assert np.array_equal(found, expected)


def normalised_errors(model, missions: int) -> np.ndarray:
    """NEES of one person's track after 12 and 24 scans, 0.2 to 0.5 s apart, of each mission.

    Each person's acceleration is white noise, of the density that a step of `NCV` has.
    """
    rng, found, density = np.random.default_rng(0), [], SIGMA**2 * DT
    prior = Gaussian(np.zeros(4), np.diag([0.02, 0.02, 1.0, 1.0]))
    for _ in range(missions):
        state, now = rng.multivariate_normal(prior.mean, prior.covariance), 0.0
        subject = tracker(model, Track(0, prior), survival=1.0, clutter_density=1e-9, birth_density=1e-9)
        for k in range(25):
            if k:
                gap = rng.uniform(0.2, 0.5)
                Q = density * np.array([[gap**3 / 3, gap**2 / 2], [gap**2 / 2, gap]])
                moved = np.concatenate([state[:2] + gap * state[2:], state[2:]])
                state = rng.multivariate_normal(moved, np.kron(Q, np.eye(2)))
                now += gap
            step(subject, now, rng.multivariate_normal(state[:2], NOISE))
            if k in (12, 24):
                (track,) = subject.tracks
                error = track.belief.mean - state
                found.append(error @ np.linalg.solve(track.belief.covariance, error))
    return np.array(found)


def test_beliefs_of_scans_at_random_times_are_consistent():
    low, high = nees_interval(200, 4)
    assert low < normalised_errors(NCV, 100).mean() < high
    assert normalised_errors(Minimal(), 30).mean() > nees_interval(60, 4)[1]  # times rounded to steps of dt


@MODELS
@pytest.mark.parametrize("management", ["existence", "m_of_n"])
@pytest.mark.parametrize("gap", [1080.0, 864_000.0, 1.7e9])
def test_a_long_gap_leaves_no_nan_and_the_next_scans_a_good_track(model, gap, management):
    """At `survival` = 0.5 the probability of existence is zero after 1080 s; step by step, ten days took 106 s."""
    subject = tracker(model, survival=0.5, management=management)
    rng = np.random.default_rng(0)
    for k in range(24):
        now = DT * k + (gap if k >= 12 else 0.0)
        step(subject, now, rng.normal([DT * (k % 12), 0.0], 0.05))
        assert all(np.isfinite(t.belief.mean).all() and 0.0 < t.existence <= 1.0 for t in subject.tracks)
    (track,) = subject.tracks
    assert np.linalg.norm(track.belief.mean[2:]) == pytest.approx(1.0, abs=0.3)
    assert track.existence > 0.99


@pytest.mark.parametrize("variance", [1e2, 1e20, 1e40, 1e300])
def test_a_person_of_a_very_wide_belief_is_somewhere_in_the_area(variance):
    undetected = UndetectedIntensity((100.0, 60.0), 4.0, 0.99, 1.75)
    wide = Track(0, Gaussian(np.array([10.0, 20.0, 0.0, 0.0]), variance * np.eye(4)))
    undetected.step(0.0, [], [wide], OPEN)
    undetected.step(1.0, [], [], OPEN)
    people = undetected.belief.people
    assert people.sum() == pytest.approx(5.0) and people.min() >= 0.0


def test_existence_of_zero_is_the_limit_of_small_ones():
    beta, given, after = existence_association(np.array([[1.0]]), np.array([[0.9, 0.9]]), 1e-6, np.array([0.0]))
    np.testing.assert_allclose(beta, [[1.0, 0.0]], atol=1e-80)
    np.testing.assert_allclose(given, [[0.1 / (0.1 + 0.9e6), 0.9e6 / (0.1 + 0.9e6)]], rtol=1e-12)
    assert 0.0 <= after[0] < 1e-80


@pytest.mark.parametrize("tracks", [1, 3, EXACT_SIDE + 2])
@pytest.mark.parametrize("least", [0.0, 5e-324, 1e-310, 1e-200, 1e-90])
def test_tiny_probabilities_of_existence_give_probabilities(least, tracks):
    rng = np.random.default_rng(tracks)
    likelihood, detection = rng.uniform(0.1, 1.0, (tracks, tracks)), np.full((tracks, tracks + 1), 0.9)
    for existence in (np.full(tracks, least), np.where(np.arange(tracks) % 2, 0.5, least)):
        beta, given, after = existence_association(likelihood, detection, 1e-6, existence)
        for shares in (beta, given):
            np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-9)
            assert shares.min() >= 0.0
        assert np.all((after >= 0.0) & (after <= 1.0))


def test_a_model_of_dt_and_predict_all_alone_tracks():
    subject, learning = tracker(Minimal()), tracker(NCV)
    for k in range(10):
        for each in (subject, learning):
            step(each, DT * k, [DT * k, 0.0])
    (one,), (other,) = subject.tracks, learning.tracks
    assert np.array_equal(one.belief.mean, other.belief.mean)
