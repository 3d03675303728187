"""The camera's covariance against the errors of five thousand detections, and the fit of its constants."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from sim.calibration.fit import fit_whole
from sim.calibration.nees import nees, nees_bins
from sim.calibration.scenes import people_in_forests
from tracking.detection.blob_detector import located_detections
from tracking.detection.detection_errors import WHOLE
from tracking.detection.ground_measurement import detections_of
from tracking.detection.partial_visibility import locate


@pytest.fixture(scope="module")
def population():
    """Detected people; trees or the image's edge hide a third of them in part."""
    return people_in_forests(7, 50)


@pytest.fixture(scope="module")
def parts(population):
    return [sample for sample in population if sample.hidden > 0.0]


@pytest.fixture(scope="module")
def placed(parts):
    return [located_detections(s.frame, [s.blob], s.forest) for s in parts]


def errors(population, found):
    """Errors (N, 2) along and across the line of sight, one way being away from the camera."""
    rows = []
    for sample, detections in zip(population, found, strict=True):
        offset = sample.person - sample.frame.pose.position[:2]
        u = offset / np.linalg.norm(offset)
        error = detections.ground[0] - sample.person
        rows.append((error @ u, error @ [-u[1], u[0]]))
    return np.array(rows)


def test_nees_lies_in_its_95_percent_interval_at_all_angles_and_hidden_shares():
    bins = nees_bins(people_in_forests(2, 165))
    assert bins[-1].count > 5000 and all(row.count > 250 for row in bins)
    assert [row for row in bins if not row.holds] == []


def test_people_seen_in_part_are_placed_without_bias_and_twice_as_well(parts, placed):
    mapped, blind = errors(parts, placed), errors(parts, [detections_of(s.frame, [s.blob]) for s in parts])
    hidden = np.array([s.hidden for s in parts])
    for low, high in ((0.0, 0.3), (0.3, 0.6), (0.6, 0.9)):
        within = (hidden > low) & (hidden <= high)
        assert within.sum() > 100
        assert np.abs(mapped[within].mean(axis=0)).max() < 0.03
    half = (hidden > 0.4) & (hidden < 0.9)
    assert np.square(mapped[half]).sum() < 0.25 * np.square(blind[half]).sum()


def test_the_less_shows_the_wider_the_covariance(parts, placed):
    hidden = np.array([s.hidden for s in parts])
    spread = np.array([math.sqrt(np.trace(d.covariances[0])) for d in placed])
    means = [spread[(hidden > a) & (hidden <= a + 0.2)].mean() for a in (0.0, 0.2, 0.4, 0.6, 0.8)]
    assert means == sorted(means) and means[-1] > 2 * means[0]


def test_people_seen_whole_are_placed_by_their_centroids_alone(population):
    whole = [s for s in population[:600] if s.hidden == 0.0 and locate(s.frame, s.blob, s.forest) is None]
    assert len(whole) > 300
    for sample in whole:
        one, other = (
            located_detections(sample.frame, [sample.blob], sample.forest),
            detections_of(sample.frame, [sample.blob]),
        )
        assert one.ground.tobytes() == other.ground.tobytes()
        assert one.covariances.tobytes() == other.covariances.tobytes()


@pytest.mark.parametrize("pixels", [96, 128, 192, 256])
def test_nees_is_two_at_other_resolutions_and_for_parts_lies_in_its_interval(pixels):
    population = people_in_forests(3, 30, pixels)
    assert 1.8 < nees(population).mean() < 2.2
    for low, high in ((0.0, 0.5), (0.5, 1.0)):
        parts = nees([s for s in population if low < s.hidden <= high])
        assert len(parts) > 80
        interval = chi2.ppf((0.025, 0.975), 2 * len(parts)) / len(parts)
        assert interval[0] <= parts.mean() <= interval[1]


@pytest.mark.slow
def test_the_constants_in_force_are_those_that_the_fit_gives():
    gsd = np.array([0.1, 0.15, 0.2, 0.3])
    for mine, theirs in zip(WHOLE.variances(gsd), fit_whole(0, 1200).variances(gsd), strict=True):
        powers = 0.4 ** np.arange(3)
        np.testing.assert_allclose(mine @ powers, theirs @ powers, rtol=0.02)
