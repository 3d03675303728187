"""People behind the leaves of porous crowns: how often they are detected, as one person each, and how precisely."""

import math
from itertools import pairwise

import numpy as np
import pytest
from helpers.covariance_fit import fit_leaves, sample_leafy
from helpers.nees_bins import bin_leaves
from helpers.views import CAMERA, SCENARIO

from sim.scenario.environment import Area, Trees
from sim.scenario.uavs import DEFAULT_FLEET
from sim.sensing.detection_truth import MaskDetector, match_detections
from sim.sensing.renderer import Renderer
from sim.world.forest import grow
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detection_errors import LEAF
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import at_target_height

PEOPLE = 6
DENSITIES = (0.3, 1.0, 2.0, 3.0)
# Free shares of lines of sight, and views: pixels along an edge, and altitudes.
BINS = (0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
USUAL = (128, tuple(uav.altitude for uav in DEFAULT_FLEET))
VIEWS = {"usual": USUAL, "fine": (256, USUAL[1]), "high": (128, (35.0,)), "high and fine": (256, (35.0,))}


def detected_people(frames, density, view, seed):
    """Rows of each person in random frames: free share, expected and actual detections; and detections less people."""
    rng, rows, surplus = np.random.default_rng([int(10 * density), seed]), [], []
    pixels, altitudes = view
    camera = Camera(CAMERA.fov, pixels)
    forest = grow(Trees(density=90, canopy_radius=2.5, leaf_area_density=density), Area(80.0, 80.0), rng)
    detectors = BlobDetector(), MaskDetector()
    with World(SCENARIO, forest, PEOPLE, seed) as world:
        renderer = Renderer(world)
        for k in range(frames):
            pose = Pose.level(*rng.uniform(-25, 25, 2), altitudes[k % len(altitudes)])
            half = pose.position[2] * math.tan(CAMERA.fov / 2) - 2.0
            grid = np.array([(x, y) for x in (-0.8, 0.0, 0.8) for y in (-0.5, 0.5)])
            people = pose.position[:2] + half * grid + rng.uniform(-1.0, 1.0, (PEOPLE, 2))
            world.place_people(people, rng.uniform(-math.pi, math.pi, PEOPLE))
            seen = renderer.render(camera, pose)
            frame = Frame(0, 0.0, camera, pose, seen.image, forest)
            found = detectors[0].detect(frame), detectors[1].detect(frame, seen.people)
            matches = [match_detections(each.pixels, seen.people, PEOPLE) >= 0 for each in found]
            points = at_target_height(people)
            shares = forest.free_shares(pose.position, points)[0]
            rows += zip(shares, forest.detectabilities(camera.lens(pose), points), *matches, strict=True)
            surplus.append(len(found[0].ground) - matches[0].sum())
    return np.array(rows, dtype=float), np.array(surplus)


def check_bins(rows, fewest):
    """Both detectors detect people of each range of free shares as often as expected.

    That is to 0.08, beyond three standard errors. Ranges with fewer people than `fewest` are left out; returns how many
    are not.
    """
    checked = 0
    for low, high in pairwise(BINS):
        of = (rows[:, 0] > low) & (rows[:, 0] < high)
        if of.sum() >= fewest:
            expected = rows[of, 1].mean()
            error = np.abs(rows[of, 2:].mean(axis=0) - expected).max()
            assert error < 0.08 + 3 * math.sqrt(expected * (1.0 - expected) / of.sum()), (low, high, expected)
            checked += 1
    return checked


@pytest.mark.parametrize("view", VIEWS)
def test_people_behind_leaves_are_detected_as_often_as_expected_and_once(view):
    """From two heights and with two resolutions."""
    parts = [detected_people(25, density, VIEWS[view], 0) for density in DENSITIES]
    rows, surplus = np.concatenate([rows for rows, _ in parts]), np.concatenate([more for _, more in parts])
    assert surplus.max() <= 1 and surplus.mean() < (0.01 if view == "usual" else 0.05)
    assert check_bins(rows, 20) >= 5
    assert np.abs(rows[:, 2:].mean(axis=0) - rows[:, 1].mean()).max() < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("density", DENSITIES)
def test_at_each_density_people_are_detected_as_often_as_expected_of_any_free_share(view, density):
    rows = np.concatenate([detected_people(40, density, VIEWS[view], seed)[0] for seed in range(300, 315)])
    assert check_bins(rows, 60) >= 2  # at 0.3 and with few pixels nearly all people are in two of the ranges


def test_nees_of_people_behind_leaves_is_near_two_by_the_share_that_shows():
    bins = bin_leaves(sample_leafy(3, 25))
    assert bins[-1].count > 1000 and 0.9 * 2 < bins[-1].mean < 1.15 * 2
    assert all(0.7 * 2 < each.mean < 1.5 * 2 for each in bins)


@pytest.mark.slow
def test_the_constants_in_force_are_those_that_the_fit_gives():
    found = fit_leaves(0, 100)
    np.testing.assert_allclose(found.radial, LEAF.radial, atol=0.001)
    np.testing.assert_allclose(found.tangential, LEAF.tangential, atol=0.001)
