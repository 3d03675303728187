"""The camera's covariance against the errors of thousands of detections, level and tilted, and its fitted constants."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.covariance_fit import fit_part, fit_powers, fit_split, fit_whole, sample_forests
from helpers.nees_bins import Bin, bin_nees, bin_pairs, bin_tilts, compute_nees
from helpers.rendered_people import draw_tilted_attitudes
from helpers.views import CAMERA
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from tracking.detection.blob_detector import find_blobs, locate_people
from tracking.detection.detection_errors import SPLIT, WHOLE, pixel_footprints, sight_axes, whole_covariances
from tracking.detection.detector import Frame
from tracking.detection.ground_measurement import detections_of, split_covariances
from tracking.detection.noise import NoiseModel
from tracking.detection.partial_visibility import PART_ERROR, find_places
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import OUTLINE, TARGET_HEIGHT
from tracking.geometry.visibility import Forest

IMAGE = np.full((128, 128, 3), (100, 115, 75), dtype=np.uint8)


@cache
def fifty_frames():
    return sample_forests(2, 50)


@pytest.fixture(scope="module")
def population():
    """Detected people; trees or the image's edge hide a third of them in part."""
    return fifty_frames()


@pytest.fixture(scope="module")
def parts(population):
    return [sample for sample in population if sample.hidden > 0.0]


@pytest.fixture(scope="module")
def placed(parts):
    return [locate_people(s.frame, [s.blob]) for s in parts]


def errors(population, found):
    """Errors (N, 2) along and across the line of sight, one way being away from the camera."""
    rows = []
    for sample, detections in zip(population, found, strict=True):
        offset = sample.person - sample.frame.pose.position[:2]
        u = offset / np.linalg.norm(offset)
        error = detections.ground[0] - sample.person
        rows.append((error @ u, error @ [-u[1], u[0]]))
    return np.array(rows)


@pytest.mark.parametrize("frames", [50, pytest.param(165, marks=pytest.mark.slow)])
def test_nees_lies_in_its_95_percent_interval_at_all_angles_and_hidden_shares(frames):
    """Of fifty frames it finds covariances that are wrong by a tenth over all, or by a third in one bin."""
    bins = bin_nees(fifty_frames() if frames == 50 else sample_forests(2, frames))
    assert bins[-1].count > 30 * frames and all(row.count > 1.5 * frames for row in bins)
    assert [row for row in bins if not row.holds] == []


def test_people_seen_in_part_are_placed_without_bias_and_less_surely(parts, placed):
    mapped, blind = errors(parts, placed), errors(parts, [detections_of(s.frame, [s.blob]) for s in parts])
    hidden = np.array([s.hidden for s in parts])
    for low, high in ((0.0, 0.3), (0.3, 0.6), (0.6, 0.9)):
        within = (hidden > low) & (hidden <= high)
        assert within.sum() > 100 and np.abs(mapped[within].mean(axis=0)).max() < 0.03
    half = (hidden > 0.4) & (hidden < 0.9)
    assert np.square(mapped[half]).sum() < 0.25 * np.square(blind[half]).sum()
    spread = np.array([math.sqrt(np.trace(d.covariances[0])) for d in placed])
    means = [spread[(hidden > a) & (hidden <= a + 0.2)].mean() for a in (0.0, 0.2, 0.4, 0.6, 0.8)]
    assert means == sorted(means) and means[-1] > 2 * means[0]


def test_people_cut_off_by_the_images_edge_are_near_where_they_would_be_seen_whole():
    """The centroid of what shows is three to five times as far off as what is found."""
    camera, pose, turns = Camera(math.radians(60), 512), Pose.level(0.0, 0.0, 20.0), np.linspace(0, 2 * math.pi, 40)
    edge = (20.0 - TARGET_HEIGHT) * math.tan(math.radians(30))
    rings = [np.column_stack([r * np.cos(turns), r * np.sin(turns), np.full(40, h)]) for h, r in OUTLINE]
    grid = np.stack(np.meshgrid(np.arange(-99.5, 612), np.arange(-99.5, 612)), axis=-1).reshape(-1, 2)
    for place in ([edge, -7.0, 0.0], [edge + 0.2, -7.0, 0.0], [edge - 0.1, edge - 0.1, 0.0]):
        drawn = camera.project(pose, np.concatenate(rings) + place)[0]
        whole = grid[Delaunay(drawn).find_simplex(grid) >= 0]
        blob = whole[np.all((whole > 0) & (whole < 512), axis=1)]
        found = detections_of(Frame(0, 0.0, camera, pose, np.zeros((512, 512, 3), np.uint8)), [blob]).pixels[0]
        centre = whole.mean(axis=0)
        assert np.abs(found - centre).max() < min(2.0, 0.35 * np.abs(blob.mean(axis=0) - centre).max())


def test_people_seen_whole_are_placed_by_their_centroids_alone(population):
    whole = [s for s in population[:600] if s.hidden == 0.0 and find_places(s.frame, s.blob, s.forest) is None]
    assert len(whole) > 300
    for sample in whole:
        one = locate_people(sample.frame, [sample.blob])
        other = detections_of(sample.frame, [sample.blob])
        assert one.ground.tobytes() == other.ground.tobytes()
        assert one.covariances.tobytes() == other.covariances.tobytes()


@pytest.mark.parametrize("pixels", [96, *(pytest.param(n, marks=pytest.mark.slow) for n in (128, 192, 256))])
def test_nees_is_two_at_other_resolutions_and_for_parts_lies_in_its_interval(pixels):
    population = sample_forests(3, 30, pixels)
    assert 1.8 < compute_nees(population).mean() < 2.2
    for low, high in ((0.0, 0.5), (0.5, 1.0)):
        parts = compute_nees([s for s in population if low < s.hidden <= high])
        assert len(parts) > 80
        interval = chi2.ppf((0.025, 0.975), 2 * len(parts)) / len(parts)
        assert interval[0] <= parts.mean() <= interval[1]


@pytest.mark.slow
def test_the_constants_in_force_are_those_that_the_fit_gives():
    gsd = np.array([0.1, 0.15, 0.2, 0.3])
    for mine, theirs in zip(WHOLE.variances(gsd), fit_whole(0, 1200).variances(gsd), strict=True):
        powers = 0.4 ** np.arange(3)
        np.testing.assert_allclose(mine @ powers, theirs @ powers, rtol=0.02)


def posed(tilt_deg=0.0, yaw_deg=0.0, roll_deg=0.0):
    turn = Rotation.from_euler("ZYX", [yaw_deg, -tilt_deg, roll_deg], degrees=True)
    return Pose(np.array([3.0, -2.0, 19.0]), turn.as_quat())


@pytest.mark.parametrize("pose", [posed(), posed(30.0, 40.0), posed(45.0, -110.0, 20.0), posed(-20.0, 0.0, -20.0)])
def test_a_pixels_footprint_is_the_spread_of_its_neighbours_ground_points(pose):
    pixels, h = np.random.default_rng(0).uniform(0, 128, (40, 2)), 1e-4
    ground = CAMERA.ground_points(pose, pixels, TARGET_HEIGHT)
    steps = [
        (CAMERA.ground_points(pose, pixels + d, TARGET_HEIGHT) - CAMERA.ground_points(pose, pixels - d, TARGET_HEIGHT))
        for d in (np.array([h, 0.0]), np.array([0.0, h]))
    ]
    along = np.einsum("nij,dni->dnj", sight_axes(CAMERA.lens(pose), ground)[0], np.array(steps) / (2 * h))
    np.testing.assert_allclose(pixel_footprints(CAMERA.lens(pose), ground), np.sqrt((along**2).sum(axis=0)), rtol=1e-6)


def test_the_covariance_of_a_level_camera_is_that_of_the_planners_times_its_excess():
    model, pose = NoiseModel.camera(CAMERA, 19.0), posed()
    ground = CAMERA.ground_points(pose, np.random.default_rng(2).uniform(5, 123, (50, 2)), TARGET_HEIGHT)
    tangents = np.linalg.norm(ground - pose.position[:2], axis=1) / (19.0 - TARGET_HEIGHT)
    inner = tangents < WHOLE.corner
    excess = np.interp(tangents, WHOLE.tangents, WHOLE.excess)
    expected = np.array([e * model.covariance(pose.position[:2], z) for e, z in zip(excess, ground, strict=True)])
    found = whole_covariances(CAMERA.lens(pose), ground)
    assert inner.sum() > 40
    np.testing.assert_allclose(found[inner], expected[inner], rtol=1e-12, atol=1e-15)


def test_the_covariance_turns_with_the_camera_and_is_bounded_up_to_the_horizon():
    for tilt in (0.0, 30.0, 59.9):
        one, other = posed(tilt), posed(tilt, 70.0)
        ground = CAMERA.ground_points(one, np.random.default_rng(3).uniform(0, 128, (200, 2)), TARGET_HEIGHT)
        turn = Rotation.from_euler("Z", 70.0, degrees=True).as_matrix()[:2, :2]
        turned = (ground - one.position[:2]) @ turn.T + one.position[:2]
        R = whole_covariances(CAMERA.lens(one), ground)
        Q = whole_covariances(CAMERA.lens(other), turned)
        np.testing.assert_allclose(turn @ R @ turn.T, Q, rtol=1e-6, atol=1e-9)
        np.testing.assert_array_equal(R, np.swapaxes(R, 1, 2))
        distances = np.sum((ground - one.position[:2]) ** 2, axis=1) + 19.0**2
        assert np.all(np.linalg.eigvalsh(R)[:, 1] <= distances * 1.000001)


def test_only_people_told_apart_are_less_certain_the_more_the_nearer():
    image = IMAGE.copy()
    image[60:63, 90:104] = (230, 62, 0)  # wide enough for three
    image[20:23, 20:23] = (230, 62, 0)
    frame = Frame(0, 0.0, CAMERA, posed(), image)
    blobs, components = find_blobs(frame)
    assert len(blobs) > 2 and np.sum(components == components[0]) == 1
    alone, told = detections_of(frame, blobs), locate_people(frame, blobs, components)
    np.testing.assert_array_equal(alone.ground, told.ground)
    np.testing.assert_array_equal(alone.covariances[0], told.covariances[0])
    wider = told.covariances[1:] - alone.covariances[1:]
    assert np.linalg.eigvalsh(wider).min() > 0.0
    np.testing.assert_allclose(wider, split_covariances(frame, told.pixels, components)[1:], atol=1e-15)
    frame = replace(frame, forest=Forest(()))
    parts = locate_people(frame, blobs, components).covariances - locate_people(frame, blobs).covariances
    np.testing.assert_allclose(parts[1:], wider, atol=1e-15)
    traces = []
    for gap in (2.0, 4.0, 6.0, 30.0):
        pixels = np.array([[90.0, 64.0], [90.0, 64.0 + gap]])
        traces.append(np.trace(split_covariances(frame, pixels, np.zeros(2, dtype=np.int64))[0]))
    assert traces == sorted(traces, reverse=True) and traces[0] > 100 * traces[-1]


@pytest.mark.parametrize("frames", [35, pytest.param(70, marks=pytest.mark.slow)])
def test_nees_of_people_seen_whole_lies_in_its_interval_at_each_tilt(frames):
    bins = bin_tilts(0, frames)
    assert len(bins) == 6 and all(row.count > 5.7 * frames for row in bins)
    assert [row for row in bins if not row.holds] == []


@pytest.mark.parametrize("pairs", [400, pytest.param(1200, marks=pytest.mark.slow)])
def test_nees_of_people_told_apart_lies_in_its_interval(pairs):
    """Of 400 pairs it finds covariances that are wrong by a fifth or more, of 1200 by a tenth."""
    bins = bin_pairs(0, pairs)
    assert all(row.count > pairs / 4 for row in bins) and [row for row in bins if not row.holds] == []


def test_nees_of_people_seen_in_part_by_tilted_cameras_lies_in_its_interval():
    values = []
    for tilt in (15.0, 30.0, 45.0):
        views = draw_tilted_attitudes(np.random.default_rng(0), tilt, 30)
        values.append(compute_nees([s for s in sample_forests(4, 30, attitudes=views) if s.hidden > 0.0]))
    assert all(len(x) > 250 and 1.5 < x.mean() < 2.6 for x in values)
    assert Bin.of("in part", np.concatenate(values)).holds


@pytest.mark.slow
def test_the_powers_in_force_are_those_that_the_fit_to_other_people_gives():
    tangents = np.array([1.0, 1.5, 2.5])
    pixels = 0.167 * np.column_stack([1 + tangents**2, np.sqrt(1 + tangents**2)])
    theirs = fit_powers(WHOLE, 11, 250).detection_variances(tangents, pixels)
    np.testing.assert_allclose(WHOLE.detection_variances(tangents, pixels), theirs, rtol=0.25)


@pytest.mark.slow
def test_what_splitting_adds_is_what_the_fit_to_other_pairs_gives():
    tangents, gaps = (a.ravel() for a in np.meshgrid([0.1, 0.4, 0.8, 1.5], [0.4, 0.6, 0.8]))
    theirs = fit_split(11, 500).variances(tangents, gaps)
    np.testing.assert_allclose(SPLIT.variances(tangents, gaps), theirs, rtol=0.4)


@pytest.mark.slow
def test_parts_are_as_certain_as_the_fit_to_other_people_makes_them():
    error = fit_part(11, 75)
    parts = [find_places(s.frame, s.blob, s.forest) for s in sample_forests(12, 20)]
    traces = np.array([[np.trace(p.posterior(e)[1]) for e in (PART_ERROR, error)] for p in parts if p is not None])
    assert len(traces) > 150
    ratios = traces[:, 0] / traces[:, 1]
    assert 0.93 < np.exp(np.log(ratios).mean()) < 1.07
    assert np.quantile(ratios, 0.1) > 0.9 and np.quantile(ratios, 0.9) < 1.15
