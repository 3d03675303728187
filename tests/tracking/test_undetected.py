"""Intensity of undetected people against counts, sampling and conservation."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import ALL_ROUND, Camera, Pose
from tracking.geometry.line_of_sight import Raster
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree, visible_samples
from tracking.track import Track
from tracking.undetected import UndetectedIntensity, _blur

AREA, OPEN = (150.0, 100.0), Forest(())
CAMERA, POSE = Camera(math.radians(60), 128), Pose.level(3.0, -4.0, 20.0)


def track(id, x, y, variance=1.0):
    return Track(id, Gaussian(np.array([x, y, 0.0, 0.0]), variance * np.eye(4)))


def test_the_intensity_is_even_before_the_first_frame():
    belief = UndetectedIntensity(AREA, 4.0, 0.99, 3.0).belief
    assert belief.people.shape == (20, 30) and belief.cell == (5.0, 5.0)
    np.testing.assert_allclose(belief.people, 4.0 / 600)
    corners = [(-72.5, -47.5), (72.5, -47.5), (-72.5, 47.5)]
    np.testing.assert_array_equal(belief.centres()[[0, 0, -1], [0, -1, 0]], corners)


def test_a_frame_thins_each_cell_by_its_visible_share():
    rng = np.random.default_rng(0)
    forest = Forest(tuple(Tree(x, y) for x, y in ((0.0, 0.0), (8.0, -9.0), (30.0, 0.0))))
    undetected = UndetectedIntensity(AREA, 600.0, 0.9, 3.0)
    undetected.step(0.0, [(CAMERA, POSE)], (), forest)
    belief = undetected.belief
    points = belief.centres()[..., None, :] + rng.uniform(-2.5, 2.5, (20, 30, 400, 2))
    flat = np.column_stack([points.reshape(-1, 2), np.full(points[..., 0].size, TARGET_HEIGHT)])
    shown = CAMERA.sees(POSE, flat) & forest.visible(POSE.position[None], flat)[0]
    share = shown.reshape(20, 30, 400).mean(axis=2)
    np.testing.assert_allclose(belief.people, 1.0 - 0.9 * share, atol=0.9 * 0.15)
    np.testing.assert_allclose(belief.people.sum(), (1.0 - 0.9 * share).sum(), atol=0.5)
    assert belief.people.min() == pytest.approx(0.1)


def test_ground_that_is_not_yet_seen_keeps_the_people_whom_its_trees_may_hide():
    """The west is seen; in the east stand 0.05 trees per m², so that looking there again is worth something."""
    density = np.zeros((50, 75))
    density[:, 41:] = 0.05
    unseen = Forest((), unknown=Raster.over(AREA, density), unknown_tree=Tree(0.0, 0.0, 2.0, 3.0, 6.0))
    undetected = UndetectedIntensity(AREA, 600.0, 0.9, 3.0)
    undetected.step(0.0, [(CAMERA, Pose.level(5.0, 0.0, 20.0))], (), unseen)
    west, east = undetected.belief.people[9:11, 14], undetected.belief.people[9:11, 17]  # both in view
    np.testing.assert_allclose(west, 1.0 - 0.9)
    beside = 3.0 / (20.0 - TARGET_HEIGHT) * math.hypot(7.5, 2.5)  # m, of the line of sight, as seen from above
    free = math.exp(-0.05 * 2.0 * (math.pi * 2.0 + 2.0 * beside))
    np.testing.assert_allclose(east, 1.0 - 0.9 * free, atol=0.02)


def test_people_spread_as_they_walk_within_the_area():
    undetected = UndetectedIntensity(AREA, 0.0, 0.99, 3.0)
    undetected.step(0.0, (), [track(1, 2.5, 2.5, 1e-6)], OPEN)
    undetected.step(0.0, (), [], OPEN)
    for time in (1.0, 2.5, 4.0):
        undetected.step(time, (), (), OPEN)
    people, centres = undetected.belief.people, undetected.belief.centres() - 2.5
    assert people.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(np.einsum("rc,rck->k", people, centres**2), 3.0**2 * 4.0, rtol=0.1)
    for time in range(5, 200):
        undetected.step(float(time), (), (), OPEN)
    assert undetected.belief.people.sum() == pytest.approx(1.0)


def test_people_spread_by_the_filter_of_scipy():
    rows = np.random.default_rng(0).random((12, 3))
    for sigma in (0.0, 0.05, 0.35, 0.6, 1.1, 2.45):
        expected = gaussian_filter1d(rows, sigma, axis=0) if sigma else rows
        np.testing.assert_allclose(_blur(rows, sigma), expected, rtol=0, atol=1e-12)


def test_people_of_deleted_tracks_but_not_duplicates_are_recycled_in_the_area():
    undetected = UndetectedIntensity(AREA, 0.0, 0.99, 3.0)
    undetected.step(0.0, (), [track(1, 20.0, -10.0, 25.0), track(2, -40.0, 0.0)], OPEN)
    assert not undetected.belief.people.any()
    undetected.step(0.0, (), [track(2, -40.0, 0.0)], OPEN)
    belief = undetected.belief
    assert belief.people.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(np.einsum("rc,rck->k", belief.people, belief.centres()), [20.0, -10.0], atol=0.01)
    undetected = UndetectedIntensity(AREA, 0.0, 0.99, 3.0)
    undetected.step(0.0, (), [track(1, 20.0, -10.0, 25.0)], OPEN)
    undetected.step(0.0, (), [track(7, 22.0, -10.0)], OPEN)
    assert not undetected.belief.people.any()
    undetected = UndetectedIntensity(AREA, 0.0, 0.99, 3.0)
    undetected.step(0.0, (), [track(1, 500.0, 0.0)], OPEN)
    undetected.step(0.0, (), [], OPEN)
    assert undetected.belief.people[:, -1].sum() == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("tilt", [50.0, 61.0, 80.0])
def test_a_camera_thins_what_it_sees_also_if_it_sees_the_sky(tilt):
    pose = Pose(
        np.array([0.0, 0.0, 20.0]),
        np.array([math.sin(math.radians(tilt) / 2), 0.0, 0.0, math.cos(math.radians(tilt) / 2)]),
    )
    undetected = UndetectedIntensity(AREA, 600.0, 0.9, 3.0)
    undetected.step(0.0, [(CAMERA, pose)], (), OPEN)
    centres = undetected.belief.centres().reshape(-1, 2)
    shown = CAMERA.sees(pose, np.column_stack([centres, np.full(len(centres), TARGET_HEIGHT)]))
    assert shown.sum() > 20
    assert undetected.belief.people.sum() == pytest.approx(600.0 - 0.9 * shown.sum(), abs=10.0)


@pytest.mark.parametrize("camera", [CAMERA, Camera(ALL_ROUND, 128)], ids=["pinhole", "all round"])
def test_each_cell_is_thinned_by_the_share_of_its_samples_in_view(camera):
    """To the bit, as for a belief that is as wide as the cell."""
    rng = np.random.default_rng(4)
    forest = Forest(tuple(Tree(*rng.uniform(-12, 12, 2), 2.0, leaf_area_density=d) for d in (math.inf, 0.3, 0.6)))
    undetected = UndetectedIntensity(AREA, 40.0, 0.9, 3.0)
    before, tilt = undetected.belief, math.radians(15.0)
    pose = Pose(np.array([3.0, -4.0, 20.0]), np.array([math.sin(tilt), 0.0, 0.0, math.cos(tilt)]))
    undetected.step(0.0, [(camera, pose)], (), forest)
    centres = before.centres().reshape(-1, 2)
    spread = np.tile(np.diag(np.square(before.cell) / 12.0), (len(centres), 1, 1))
    share = visible_samples(forest, centres, spread, camera.lens(pose))[:, 0].mean(axis=1)
    assert len(np.unique(share)) > 5
    np.testing.assert_array_equal(undetected.belief.people.ravel(), before.people.ravel() * (1.0 - 0.9 * share))
