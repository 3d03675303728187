"""Free shares of lines of sight through porous crowns, and what they mean for a belief."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.porous import make_porous, plain_detectabilities, sampled_share
from helpers.views import CAMERA

from sim.scenario.uavs import DEFAULT_FLEET
from tracking.geometry.camera import Pose
from tracking.geometry.leaf_gaps import USUAL_PIXEL, USUAL_SLOPE, detectable_share, lower_detectabilities
from tracking.geometry.lens import pixel_size
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import (
    SAMPLE_VARIANCE,
    SAMPLES,
    THRESHOLDS,
    Forest,
    Tree,
    detectable_shares,
    visible_samples,
)

KINDS = ("above", "anywhere", "upright", "level")


def scene(rng, trees, *, span=12.0, trunk=0.3):
    """Crowns of all sizes that overlap."""
    found = []
    for x, y, radius, base, height in rng.uniform(
        [-span, -span, 1.0, 0.5, 0.0], [span, span, 4.0, 4.0, 5.0], (trees, 5)
    ):
        found.append(Tree(x, y, radius, base, base + height, trunk))
    return Forest(tuple(found))


def segments(rng, kind, span=12.0):
    """Cameras (10, 3) and points (40, 3)."""
    lowest = 17.0 if kind == "above" else -1.0
    cameras, points = rng.uniform([-span, -span, lowest], [span, span, 22], (10, 3)), rng.uniform(-span, span, (40, 3))
    points[:, 2] = TARGET_HEIGHT if kind == "above" else rng.uniform(0, 7, 40)
    if kind == "upright":
        points[:, :2] = np.repeat(cameras[:, :2], 4, axis=0)
    if kind == "level":
        cameras[:, 2] = points[:, 2] = 3.0
    return cameras, points


def test_the_usual_pixel_and_slope_are_means_of_the_default_cameras():
    """Of people anywhere in their images, by sampling; the altitudes are those of the default fleet."""
    rng, tangent = np.random.default_rng(0), math.tan(math.radians(30))
    slopes = np.hypot(*(tangent * rng.uniform(-1, 1, (2, 10_000))))
    assert pytest.approx(slopes.mean(), abs=0.05) == USUAL_SLOPE
    pixels = [2 * tangent * (uav.altitude - TARGET_HEIGHT) / 128 for uav in DEFAULT_FLEET]
    assert pytest.approx(np.mean(pixels), abs=0.01) == USUAL_PIXEL
    assert detectable_share(0.3) == detectable_share(0.3, USUAL_PIXEL, USUAL_SLOPE)


@pytest.mark.parametrize("kind", KINDS)
def test_free_shares_are_those_of_the_extinction_summed_along_the_line(kind):
    rng, errors, partly = np.random.default_rng(0), [], 0
    for _ in range(3):
        forest = make_porous(scene(rng, 12, trunk=0.0), rng, opaque=0.0)
        cameras, points = segments(rng, kind)
        found = forest.free_shares(cameras, points)
        for i, j in np.ndindex(found.shape):
            errors.append(found[i, j] - sampled_share(cameras[i], points[j], forest.canopies))
        partly += np.sum((found > 0.02) & (found < 0.98))
    assert np.abs(errors).max() < 0.02 and abs(np.mean(errors)) < 1e-3 and partly > 50


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("span", [12.0, 60.0])
def test_trees_hide_independently_whether_the_raster_finds_them_or_all_are_tried(kind, span):
    rng, porous, solid = np.random.default_rng(1), 0, 0
    for _ in range(3):
        forest = make_porous(scene(rng, int(span), span=span), rng)
        cameras, points = segments(rng, kind, span)
        alone = np.prod([Forest((tree,)).free_shares(cameras, points) for tree in forest.trees], axis=0)
        found = forest.free_shares(cameras, points)
        np.testing.assert_allclose(found, alone, rtol=1e-12, atol=1e-300)
        np.testing.assert_allclose(Forest(forest.trees).free_shares(points, cameras).T, found, rtol=1e-9, atol=1e-300)
        porous, solid = porous + np.sum((found > 0) & (found < 1)), solid + np.sum(found == 0)
    assert porous > 30 and solid > 30


def test_a_crown_of_no_leaves_hides_nothing_and_one_of_many_as_much_as_an_opaque_one():
    rng = np.random.default_rng(2)
    opaque = scene(rng, 20, trunk=0.0)
    cameras, points = segments(rng, "above")
    shares = []
    for density in (0.0, 0.2, 1.0, 1e6, math.inf):
        trees = tuple(replace(tree, leaf_area_density=density) for tree in opaque.trees)
        shares.append(Forest(trees).free_shares(cameras, points))
        assert Forest(trees).is_porous == (density < math.inf)
        np.testing.assert_array_equal(
            Forest(trees, "disc").free_shares(cameras, points),
            Forest(opaque.trees, "disc").free_shares(cameras, points),
        )
    assert np.all(shares[0] == 1) and np.all(np.diff(shares, axis=0) <= 0) and np.mean(shares[1] > shares[2]) > 0.3
    assert np.mean(shares[3] != shares[4]) < 0.01
    above = Forest((Tree(0.0, 0.0, 3.0, 2.0, 6.0, 0.0, 0.5),)).free_shares(
        np.array([1, 0, 20.0]), np.array([1, 0, 0.85])
    )
    assert above[0, 0] == pytest.approx(math.exp(-0.5 * 0.5 * 4.0), rel=1e-14)


def test_the_detectable_share_grows_from_zero_to_one():
    shares = detectable_shares(np.linspace(0, 1, 101))
    assert shares[0] == detectable_share(0.0) == 0.0 and shares[-1] == detectable_share(1.0) == 1.0
    assert np.all(np.diff(shares) > 0) and shares[30] == detectable_share(0.3)


def test_the_law_for_cameras_side_by_side_is_that_for_one_and_trees_hide_shares_of_their_own():
    rng, partly = np.random.default_rng(4), 0
    for _ in range(3):
        forest = make_porous(scene(rng, 12), rng)
        cameras, points = segments(rng, "above")
        cameras[:, 2] = 18.0
        expected = forest.free_shares(cameras, points)
        for j, point in enumerate(points):
            found = np.ones(len(cameras))
            hidden = lower_detectabilities(
                found, cameras.T[:2].copy(), 18.0, tuple(point), 0.1, forest.blockers, forest.grid.unknown
            )
            plain = [plain_detectabilities(forest, camera, point, 0.1, 0.0)[0] for camera in cameras]
            np.testing.assert_allclose(found, plain, rtol=1e-9, atol=1e-9)
            assert hidden == np.sum(expected[:, j] == 0.0)
        for i, camera in enumerate(cameras):
            lens = CAMERA.lens(Pose.level(*camera))
            plain = [plain_detectabilities(forest, camera, p, pixel_size(lens, tuple(p)))[0] for p in points]
            np.testing.assert_allclose(forest.detectabilities(lens, points), plain, rtol=1e-9, atol=1e-9)
            each = forest.shares_hidden(camera, points)
            np.testing.assert_allclose(np.prod(1.0 - each, axis=1), expected[i], rtol=1e-12, atol=1e-12)
        partly += np.sum((expected > 0.02) & (expected < 0.98))
    assert partly > 30


def test_samples_shown_by_a_share_have_the_mean_and_the_width_of_all():
    """The mean exactly; the second moments within 0.10 of their part of all samples."""
    np.testing.assert_allclose(np.sort(THRESHOLDS), np.repeat((np.arange(18) + 0.5) / 18, 2), rtol=1e-15)
    worst = 0.0
    for share in np.linspace(0.0, 1.0, 37):
        shown = share > THRESHOLDS
        assert abs(shown.mean() - share) <= 1 / 36 + 1e-12
        np.testing.assert_allclose(SAMPLES[shown].sum(axis=0), 0.0, atol=1e-12)
        second = SAMPLES[shown].T @ SAMPLES[shown] / 36 - shown.mean() * (1.0 - SAMPLE_VARIANCE) * np.eye(2)
        worst = max(worst, np.abs(np.linalg.eigvalsh(second)).max())
    assert worst < 0.10
    assert (1.0 > THRESHOLDS).all() and not (0.0 > THRESHOLDS).any()


def test_as_many_samples_show_as_people_are_detected_and_other_frames_from_there_show_the_same():
    rng, errors = np.random.default_rng(3), []
    for _ in range(150):
        forest = make_porous(scene(rng, 12), rng)
        mean, root = rng.uniform(-6, 6, 2), rng.normal(size=(2, 2))
        belief = mean[None], (root @ root.T + 0.1 * np.eye(2))[None]
        pose = Pose.level(*rng.uniform(-3, 3, 2), 20.0)
        lens = CAMERA.lens(pose)
        views = visible_samples(forest, *belief, lens, lens)
        assert np.array_equal(views[:, 0], views[:, 1])
        drawn = np.column_stack([rng.multivariate_normal(mean, belief[1][0], 2000), np.full(2000, TARGET_HEIGHT)])
        truth = CAMERA.sees(pose, drawn) * forest.detectabilities(lens, drawn)
        errors.append(views[:, 0].mean() - truth.mean())
    assert abs(np.mean(errors)) < 0.01 and np.sqrt(np.mean(np.square(errors))) < 0.07
