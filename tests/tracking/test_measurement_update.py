"""Scans without measurements."""

import numpy as np
from helpers.scenes import MOTION

from tracking.measurement_update import ScanPrediction, scan_update
from tracking.tracker import TrackerParameters

PARAMETERS = TrackerParameters(MOTION, clutter_density=1e-3)


def scene(rng, people, side):
    """Beliefs of people in a square of `side` m, wide and narrow."""
    roots = 0.3 * rng.normal(size=(people, 4, 4)) * rng.choice([0.5, 1.0, 3.0], (people, 1, 1))
    covariances = roots @ np.swapaxes(roots, 1, 2) + 0.02 * np.eye(4)
    means = np.column_stack([rng.uniform(0, side, (people, 2)), rng.normal(size=(people, 2))])
    undetected = means + 0.1 * rng.normal(size=means.shape), 0.9 * covariances
    existence, visible, shown = rng.uniform(0.5, 0.999, people), rng.random(people), rng.random(people)
    return ScanPrediction(means, covariances, undetected, existence, visible, shown)


def test_a_scan_without_measurements_leaves_what_was_predicted():
    before = scene(np.random.default_rng(0), 150, 100.0)
    after = scan_update(before, np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), PARAMETERS.association)
    np.testing.assert_array_equal(after.means, before.means)
    np.testing.assert_array_equal(after.covariances, before.covariances)
    assert np.all(after.missed == 1.0) and after.gates.shape == (0, 2)
