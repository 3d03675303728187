"""Association and a whole tracker against Stone Soup's JPDA."""

import math

import numpy as np
import pytest
from helpers.peers import StoneSoup
from helpers.scenes import MOTION, R, scan, track, tracker
from stonesoup.dataassociator.probability import JPDA
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.updater.kalman import KalmanUpdater

from tracking.association.jpda import existence_association, gated_likelihood
from tracking.fusion.consensus import fuse
from tracking.parameters import TrackerParameters
from tracking.settings import DAY


class EachItsOwn:
    """A hypothesiser for each of Stone Soup's tracks, because its probability of detection is one number."""

    def __init__(self, hypothesisers):
        self.hypothesisers = hypothesisers

    def hypothesise(self, track, detections, timestamp, **kwargs):
        return self.hypothesisers[track].hypothesise(track, detections, timestamp, **kwargs)


@pytest.mark.parametrize("seed", range(6))
def test_association_matches_stone_soup(seed):
    """Gates, likelihoods and probabilities, with a different probability of detection for each track."""
    rng = np.random.default_rng(seed)
    known = [track(k, *rng.uniform(-1, 1, 4), variance=rng.uniform(0.1, 0.5)) for k in range(4)]
    p = TrackerParameters(MOTION, gate_probability=0.97, clutter_density=10 ** rng.uniform(-6, 0))
    peer, detection = StoneSoup(p, known), rng.uniform(0.0, 0.99, 4)
    z = rng.uniform(-1.5, 1.5, (5, 2))
    own = [
        PDAHypothesiser(peer.predictor, KalmanUpdater(None), p.settings.clutter_density, d, p.settings.gate_probability)
        for d in detection.tolist()
    ]
    peer.associator = JPDA(EachItsOwn(dict(zip(peer.tracks, own, strict=True))))
    detections, time = peer.detections(scan(1, *z))
    found = peer.associator.associate(peer.tracks, detections, time)
    expected = np.zeros((4, 6))
    for i, t in enumerate(peer.tracks):
        for hypothesis in found[t]:
            j = detections.index(hypothesis.measurement) + 1 if hypothesis else 0
            expected[i, j] = float(hypothesis.probability)
    means = np.array([t.belief.mean for t in known])
    predicted = MOTION.predict_all(means, np.array([t.belief.covariance for t in known]))
    likelihood = gated_likelihood(*predicted, z, np.tile(R, (5, 1, 1)), p.settings.gate_probability)
    found = np.tile(detection[:, None] * p.settings.gate_probability, 6)
    beta = existence_association(likelihood, found, p.settings.clutter_density, np.ones(4))[0]
    np.testing.assert_allclose(beta, expected, atol=1e-6)
    np.testing.assert_array_equal(beta == 0, expected == 0)  # the same gates
    assert np.count_nonzero(beta[:, 1:]) > 4 and math.isclose(expected.sum(), 4)


def test_a_tracker_on_a_whole_run_is_stone_soups():
    """Predictions, associations and mixtures of 20 scans of three crossing people, with false alarms."""
    rng = np.random.default_rng(0)
    never = (62, 62)  # no other track begins
    known = [track(k, -3 + 2 * k, 2 - 2 * k, 1 - k, k - 1) for k in range(3)]
    settings = {"detection_probability": 0.9, "clutter_density": 0.01, "gate_probability": 0.99}
    subject = tracker(*known, **settings, confirm=never, management="m_of_n", reacquire_after=DAY)
    subject.step(scan(0))
    fuse([subject], np.zeros((1, 1), bool), 0)
    peer = StoneSoup(subject.parameters, subject.tracks)
    for k in range(1, 21):
        people = np.array([t.belief.mean[:2] + 0.2 * k * t.belief.mean[2:] for t in known])
        people += rng.multivariate_normal([0, 0], R, 3)
        s = scan(k, *people[rng.random(3) < 0.9], *rng.uniform(-4, 4, (1, 2)))
        subject.step(s)
        peer.step(*peer.detections(s))
        held = {t.id: t.belief for t in subject.tracks}
        for i, belief in enumerate(peer.beliefs):
            np.testing.assert_allclose(held[i].mean, belief.mean, atol=1e-6)
            np.testing.assert_allclose(held[i].covariance, belief.covariance, atol=1e-6)
        fuse([subject], np.zeros((1, 1), bool), 0)
