"""Scans worked on in batches give what scans worked on at once give."""

import numpy as np
import pytest
from helpers.scenes import MOTION, R

from tracking.association.gating_batches import find_gating_batches
from tracking.association.jpda import gated_likelihood
from tracking.measurement_update import Measured, ScanPrediction, update_scan
from tracking.parameters import TrackerParameters
from tracking.track import Beliefs

PARAMETERS = TrackerParameters(MOTION, clutter_density=1e-3)
SHARES = np.random.default_rng(6).uniform(0.0, 1.0, 1000)  # of people that leaves leave free there
LOST = np.random.default_rng(5).uniform(0.0, 2e-3, 1000)  # 1/m², at each measurement


def scene(rng, people, side):
    """Beliefs of people in a square of `side` m, wide and narrow, and their measurements among false alarms."""
    roots = 0.3 * rng.normal(size=(people, 4, 4)) * rng.choice([0.5, 1.0, 3.0], (people, 1, 1))
    covariances = roots @ np.swapaxes(roots, 1, 2) + 0.02 * np.eye(4)
    means = np.column_stack([rng.uniform(0, side, (people, 2)), rng.normal(size=(people, 2))])
    z = means[:, :2] + np.einsum(
        "tij,tj->ti", np.linalg.cholesky(covariances[:, :2, :2] + R), rng.normal(size=(people, 2))
    )
    z = rng.permutation(np.concatenate([z[rng.random(people) < 0.9], rng.uniform(-0.2 * side, 1.2 * side, (30, 2))]))
    noise = R * rng.uniform(0.5, 2.0, (len(z), 1, 1))
    undetected = Beliefs(means + 0.1 * rng.normal(size=means.shape), 0.9 * covariances)
    existence, visible, shown = rng.uniform(0.5, 0.999, people), rng.random(people), rng.random(people)
    return ScanPrediction(means, covariances, undetected, existence, visible, shown), z, noise


@pytest.mark.parametrize("side", [400.0, 150.0, 60.0, 15.0], ids=["far apart", "some near", "groups", "one crowd"])
@pytest.mark.parametrize("certain", [True, False])
def test_a_scan_in_batches_gives_the_tracks_of_the_whole_scan(side, certain):
    """To the bit for certain tracks; existence is updated by sums, with a rounding that depends on their length."""
    rng = np.random.default_rng(int(side))
    for people in (120, 180):
        before, z, noise = scene(rng, people, side)
        before = before._replace(existence=np.ones(people)) if certain else before
        assert people * len(z) > PARAMETERS.association.at_once
        found = Measured(z, noise, SHARES[: len(z)], LOST[: len(z)])
        settings = PARAMETERS.association, PARAMETERS.association._replace(at_once=people * len(z))
        batchwise, whole = (update_scan(before, found, each) for each in settings)
        for name in ("means", "covariances", "existence", "missed", "explained"):
            ours, theirs = getattr(batchwise, name), getattr(whole, name)
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=0.0 if certain else 1e-12, err_msg=name)
        assert sorted(batchwise.gates.tolist()) == whole.gates.tolist()


@pytest.mark.parametrize("side", [400.0, 150.0, 60.0])
def test_no_measurement_is_in_a_gate_of_another_batch(side):
    rng = np.random.default_rng(7)
    before, z, noise = scene(rng, 300, side)
    gate_probability = PARAMETERS.settings.gate_probability
    numbers = find_gating_batches(before.means, before.covariances, z, noise, gate_probability)
    parts = [tuple(np.flatnonzero(of == k) for of in numbers) for k in np.unique(numbers[0])]
    tracks, measurements = (np.concatenate([part[k] for part in parts]) for k in range(2))
    np.testing.assert_array_equal(np.sort(tracks), np.arange(300))
    assert len(set(measurements.tolist())) == len(measurements) < len(z)  # false alarms far from all are in none
    gates = gated_likelihood(before.means, before.covariances, z, noise, gate_probability) > 0.0
    for rows, columns in parts:
        assert np.all(np.diff(rows) > 0) and np.all(np.diff(columns) > 0)
        assert np.all(np.isin(np.flatnonzero(gates[rows].any(axis=0)), columns))
    assert (len(parts) >= 4) == (side >= 150.0)


def test_a_scan_without_measurements_leaves_what_was_predicted():
    before, _, _ = scene(np.random.default_rng(0), 150, 100.0)
    nothing = Measured(np.zeros((0, 2)), np.zeros((0, 2, 2)), SHARES[:0], LOST[:0])
    after = update_scan(before, nothing, PARAMETERS.association)
    np.testing.assert_array_equal(after.means, before.means)
    np.testing.assert_array_equal(after.covariances, before.covariances)
    assert np.all(after.missed == 1.0) and after.gates.shape == (0, 2)
