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
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import at_target_height, detectable_shares

PEOPLE = 6


def detected_people(frames, density):
    """Rows of each person in view of random frames: expected and actual detection; and detections less people."""
    rng, rows, surplus = np.random.default_rng([int(10 * density), frames]), [], []
    forest = grow(Trees(density=90, canopy_radius=2.5, leaf_area_density=density), Area(80.0, 80.0), rng)
    detectors = BlobDetector(forest), MaskDetector(forest)
    with World(SCENARIO, forest, PEOPLE, seed=frames) as world:
        renderer = Renderer(world)
        for k in range(frames):
            pose = Pose.level(*rng.uniform(-25, 25, 2), DEFAULT_FLEET[k % 3].altitude)
            half = pose.position[2] * math.tan(CAMERA.fov / 2) - 2.0
            grid = np.array([(x, y) for x in (-0.8, 0.0, 0.8) for y in (-0.5, 0.5)])
            people = pose.position[:2] + half * grid + rng.uniform(-1.0, 1.0, (PEOPLE, 2))
            world.place_people(people, rng.uniform(-math.pi, math.pi, PEOPLE))
            view = renderer.render(CAMERA, pose)
            frame = Frame(0, 0.0, CAMERA, pose, view.image)
            found = detectors[0].detect(frame), detectors[1].detect(frame, view.people)
            matches = [match_detections(each.pixels, view.people, PEOPLE) >= 0 for each in found]
            shares = forest.free_shares(pose.position, at_target_height(people))[0]
            rows += zip(detectable_shares(shares), *matches, strict=True)
            surplus.append(len(found[0].ground) - matches[0].sum())
    return np.array(rows, dtype=float), np.array(surplus)


@pytest.mark.parametrize("frames", [60, pytest.param(400, marks=pytest.mark.slow)])
def test_people_behind_leaves_are_detected_as_often_as_expected_and_once(frames):
    """By the expected probability to 0.07 beyond three standard errors, at most 0.04 of 400 frames; in all to 0.03."""
    parts = [detected_people(frames, density) for density in (0.3, 0.8, 1.5)]
    rows, surplus = np.concatenate([rows for rows, _ in parts]), np.concatenate([more for _, more in parts])
    expected, found = rows[:, 0], rows[:, 1:]
    assert surplus.max() <= 1 and surplus.mean() < 0.01
    assert np.abs(found.mean(axis=0) - expected.mean()).max() < 0.03
    for low, high in pairwise((0.0, 0.6, 0.8, 0.9, 1.0)):
        of = (expected > low) & (expected < high)
        deviation = math.sqrt(0.2 / of.sum())
        assert np.abs(found[of].mean(axis=0) - expected[of].mean()).max() < 0.07 + 3 * deviation


def test_nees_of_people_behind_leaves_is_near_two_by_the_share_that_shows():
    bins = bin_leaves(sample_leafy(3, 25))
    assert bins[-1].count > 1000 and 0.9 * 2 < bins[-1].mean < 1.15 * 2
    assert all(0.7 * 2 < each.mean < 1.5 * 2 for each in bins)


@pytest.mark.slow
def test_the_constants_in_force_are_those_that_the_fit_gives():
    found = fit_leaves(0, 100)
    np.testing.assert_allclose(found.radial, LEAF.radial, atol=0.001)
    np.testing.assert_allclose(found.tangential, LEAF.tangential, atol=0.001)
