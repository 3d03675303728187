"""Detection and location of people hidden in part and of touching pairs."""

import math

import cv2
import numpy as np
import pytest

from sim.scenario.fleet import Uav
from sim.scenario.scenario import Scenario
from sim.sensing.detection_truth import matched_people
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree

CAMERA = Camera(math.radians(60), 128)
WIDE = Camera(2 * math.atan(80 / CAMERA.focal), 160)
FAR = Scenario(uavs=(Uav(start=(74.0, 49.0)),))
OPEN = Forest(())
ALTITUDES = (17.3, 19.1, 21.7)
GREEN = (100, 115, 75)


def test_moving_camera_and_scene_moves_the_place():
    image = np.full((128, 128, 3), GREEN, dtype=np.uint8)
    image[60:62, 90:93] = (230, 62, 0)
    there = []
    for shift in (np.zeros(2), np.array([16.0, -8.0])):
        forest = Forest((Tree(5.6 + shift[0], 2.0 + shift[1], 1.5),))
        frame = Frame(0, 0.0, CAMERA, Pose.level(*shift, 19.0), image)
        found = BlobDetector(forest).detect(frame)
        assert not np.array_equal(found.ground, BlobDetector().detect(frame).ground)
        there.append((found.ground - shift, found.covariances))
    np.testing.assert_allclose(there[0][0], there[1][0], atol=1e-6)
    np.testing.assert_allclose(there[0][1], there[1][1], atol=1e-6)


@pytest.mark.parametrize("forests", [2, pytest.param(5, marks=pytest.mark.slow)])
def test_people_visible_by_a_third_to_a_half_are_found(forests):
    rng = np.random.default_rng(3)
    people = found = detections = 0
    for _ in range(forests):
        forest = Forest(tuple(Tree(*rng.uniform(-40, 40, 2), canopy_radius=1.5) for _ in range(200)))
        with World(FAR, forest, 10) as world, World(FAR, OPEN, 10) as bare:
            full, alone = Renderer(world), Renderer(bare)
            for k in range(90):
                pose = Pose.level(*rng.uniform(-30, 30, 2), ALTITUDES[k % 3])
                places, headings = pose.position[:2] + rng.uniform(-11, 11, (10, 2)), rng.uniform(-3.1, 3.1, 10)
                for each in (world, bare):
                    each.place_people(places, headings)
                rendered = full.render(CAMERA, pose)
                whole = alone.render(WIDE, pose).people
                share = np.bincount(rendered.people[rendered.people >= 0], minlength=10)
                share = share / np.maximum(np.bincount(whole[whole >= 0], minlength=10), 1)
                partly = np.flatnonzero((share >= 0.3) & (share <= 0.5))
                pixels = BlobDetector().detect(Frame(0, 0.0, CAMERA, pose, rendered.image)).pixels
                people += len(partly)
                found += matched_people(pixels, rendered.people, 10)[partly].sum()
                detections += sum(owner(pixel, rendered.people) in partly for pixel in pixels)
    assert people > 30 * forests
    assert found / people >= 0.95
    assert found / detections >= 0.95


def owner(pixel, mask):
    """Person with the nearest pixel."""
    rows, columns = np.nonzero(mask >= 0)
    nearest = np.argmin(np.hypot(columns + 0.5 - pixel[0], rows + 0.5 - pixel[1]))
    return mask[rows[nearest], columns[nearest]]


def test_touching_pairs_are_two_people_in_any_arrangement():
    rng = np.random.default_rng(4)
    pairs = found = detections = 0
    with World(FAR, OPEN, 2) as world:
        renderer = Renderer(world)
        while pairs < 300:
            pose = Pose.level(0.0, 0.0, ALTITUDES[pairs % 3])
            bearing, gap = rng.uniform(-math.pi, math.pi), rng.uniform(0.5, 0.9)
            first = rng.uniform(-8, 8, 2)
            places = np.array([first, first + gap * np.array([math.cos(bearing), math.sin(bearing)])])
            world.place_people(places, rng.uniform(-math.pi, math.pi, 2))
            rendered = renderer.render(CAMERA, pose)
            shown = rendered.people >= 0
            both = len(np.unique(rendered.people[shown])) == 2
            if not both or cv2.connectedComponents(shown.astype(np.uint8))[0] != 2:
                continue
            pixels = BlobDetector().detect(Frame(0, 0.0, CAMERA, pose, rendered.image)).pixels
            pairs += 1
            found += matched_people(pixels, rendered.people, 2).sum()
            detections += len(pixels)
    assert found / (2 * pairs) >= 0.95
    assert found / detections >= 0.95


def test_a_long_stride_below_the_camera_is_one_person():
    rng = np.random.default_rng(3)
    camera = Camera(math.radians(60), 256)
    with World(FAR, OPEN, 1) as world:
        renderer = Renderer(world)
        for k in range(150):
            world.place_people(rng.uniform(-1, 1, (1, 2)), rng.uniform(-math.pi, math.pi, 1))
            pose = Pose.level(0.0, 0.0, ALTITUDES[k % 3])
            assert (
                len(BlobDetector().detect(Frame(0, 0.0, camera, pose, renderer.render(camera, pose).image)).ground) == 1
            )
