"""Outlines of hidden ground in a frame, and measurements on their detections."""

import math

import cv2
import numpy as np
import pytest
from helpers.flights import recorded
from helpers.poses import tilted

from sim.views.frames.frame_facts import make_frame_facts, outline_cylinder, outline_hidden_ground
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree, at_target_height

CAMERA = Camera(math.radians(60), 128)


@pytest.mark.parametrize("occlusion", ["line_of_sight", "disc"])
@pytest.mark.parametrize("tilt", [0.0, 0.5, 1.2])
def test_outlines_hold_just_the_pixels_of_hidden_ground(tilt, occlusion):
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(15):
        trees = [Tree(*rng.uniform(-30, 30, 2), rng.uniform(0.5, 5), 3.0, rng.uniform(4, 7), 0.4) for _ in range(30)]
        forest = Forest(tuple(trees), occlusion)
        pose = tilted(rng, (*rng.uniform(-20, 20, 2), rng.uniform(8, 25)), tilt)
        uv = rng.uniform(0, 128, (300, 2))
        uv = uv[CAMERA.rays(pose, uv)[:, 2] < -0.01]
        ground = CAMERA.ground_points(pose, uv, TARGET_HEIGHT)
        hidden = ~forest.visible(pose.position, np.column_stack([ground, np.full(len(ground), TARGET_HEIGHT)]))[0]
        depths = np.full(len(uv), -np.inf)  # in pixels, inside the nearest outline
        for outline in (part for tree in outline_hidden_ground(CAMERA, pose, forest) for part in tree):
            polygon = outline.astype(np.float32)[:, None]
            depths = np.maximum(depths, [cv2.pointPolygonTest(polygon, p.tolist(), True) for p in uv])
        clear = np.abs(depths) > 0.1
        np.testing.assert_array_equal(depths[clear] > 0, hidden[clear])
        assert clear.mean() > 0.95
        shares.append(hidden.mean())
    assert 0.1 < np.mean(shares) < 0.9


def test_what_is_behind_the_camera_or_below_the_target_has_no_outline():
    upwards = Pose(np.array([0.0, 0.0, 20.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    assert outline_cylinder(CAMERA, upwards, np.array([0.0, 0.0, 2.0, 3.0, 6.0])).shape == (0, 2)
    assert outline_hidden_ground(CAMERA, upwards, Forest((Tree(0.0, 0.0),))) == [[]]
    forest = Forest((Tree(0.0, 0.0, 2.0, 0.3, 0.8),))
    assert outline_hidden_ground(CAMERA, Pose.level(0, 0, 20), forest) == [[]]


def test_measurements_lie_on_their_detections_through_the_camera_that_the_uav_believes():
    wrong = ("uavs.0.camera=thermal-640", "uavs.0.camera.scale=0.25", "uavs.0.camera.believed.focal=[700, 705]")
    recording = recorded(*wrong, "sensing.noise=camera", "trees.density=0", "uavs.0.navigation=gnss", duration=1)
    gaps, others = [], []
    for k in range(len(recording.times)):
        facts = make_frame_facts(recording, k, 0)
        points = at_target_height(recording.scan_at(k, 0).measurements)
        pixels = recording.pixels_at(k, 0)
        gaps += np.hypot(*(facts.believed_camera.project(facts.believed, points)[0] - pixels).T).tolist()
        others += np.hypot(*(facts.camera.project(facts.believed, points)[0] - pixels).T).tolist()
    assert len(gaps) > 5 and np.median(gaps) < 1e-6 and np.median(others) > 1.0  # people at the edge are cut
