"""Detectors as plug-ins: by name or import string, what they may do wrong, and the one that reads the mask."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.views import CAMERA, SCENARIO

from planning.planner_loading import load_planner
from sim.mission.mission import Mission
from sim.scenario.environment import People, Trees
from sim.scenario.scenario import Scenario
from sim.scenario.sensing import DETECTORS, Sensing
from sim.scenario.uavs import Uav
from sim.sensing.detection_truth import MaskDetector, match_detections
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Detections, Frame
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree

POSE = Pose.level(0.0, 0.0, 19.0)
OPEN = Forest(())


class Fixed:
    """One person in the middle of the image, whatever it shows; paints the image black and moves the camera."""

    def detect(self, frame):
        frame.image[:] = 0
        middle = np.full((1, 2), frame.camera.pixels / 2)
        ground = frame.camera.ground_points(frame.pose, middle)
        frame.pose.position[:] = 1e3
        return Detections(middle, ground, 0.25 * np.eye(2)[None])


class Raising:
    def detect(self, frame):
        raise RuntimeError("no network")


def scenario(detector, **sensing):
    return Scenario(
        duration=0.8,
        trees=Trees(density=0.0),
        people=People(count=1),
        uavs=(Uav(start=(-28.0, -14.0)),),
        sensing=Sensing(detector=detector, **sensing),
    )


def fly(setting, seed=0):
    mission = Mission(setting, load_planner("hover"), seed)
    return mission, [(snapshot, mission.images[0]) for snapshot in mission.fly()]


@pytest.mark.parametrize("name", [*DETECTORS.built_in])
def test_every_detector_has_a_name_that_flies(name):
    mission, flown = fly(scenario(name, noise="camera"))
    assert len(flown) == 5 and mission.faults == []


@pytest.mark.parametrize("noise", ["camera", "range_bearing"])
def test_anyones_detector_measures_and_leaves_the_frame_alone(noise):
    mission, flown = fly(scenario(f"{__name__}:Fixed", noise=noise))
    assert mission.faults == []
    for snapshot, image in flown:
        scan = snapshot.scans[0]
        assert scan.measurements.shape == (1, 2) and image.max() > 0
        assert np.abs(scan.pose.position).max() < 100 and np.abs(snapshot.poses[0].position).max() < 100
        assert np.array_equal(scan.covariances[0], 0.25 * np.eye(2)) == (noise == "camera")
        error = np.linalg.norm(scan.measurements[0] - scan.pose.position[:2])
        assert error < 1e-6 if noise == "camera" else 0.0 < error < 2.0


def test_a_detector_that_fails_is_a_fault_and_a_scan_without_detections():
    mission, flown = fly(scenario(f"{__name__}:Raising"))
    assert [(f.time, f.uav, f.message) for f in mission.faults] == [
        (k / 5, 0, "detector: RuntimeError: no network") for k in range(5)
    ]
    assert all(snapshot.scans[0].measurements.shape == (0, 2) for snapshot, _ in flown)


def shown(rng, forest, count):
    """Frames over a forest with their masks, and the people."""
    with World(SCENARIO, forest, count) as world:
        renderer = Renderer(world)
        for _ in range(40):
            people = rng.uniform(-10, 10, (count, 2))
            world.place_people(people, rng.uniform(-math.pi, math.pi, count))
            rendered = renderer.render(CAMERA, POSE)
            yield Frame(0, 0.0, CAMERA, POSE, rendered.image, forest), rendered.people, people


def test_the_mask_detector_detects_exactly_the_people_with_a_visible_pixel():
    rng = np.random.default_rng(0)
    forest = Forest(tuple(Tree(x, y, 2.0) for x in (-6.0, 0.0, 6.0) for y in (-6.0, 0.0, 6.0)))
    crowded = 0
    for frame, mask, people in shown(rng, forest, 12):
        ids = np.unique(mask[mask >= 0])
        found = MaskDetector().detect(frame, mask)
        assert np.sum(match_detections(found.pixels, mask, 12) >= 0) == len(ids)
        # Each stands on a person of its own, at the pixel nearest to the middle of all of them, and, whatever hides it,
        # lies within a body's length of one person.
        columns, rows = found.pixels.astype(int).T
        own = mask[rows, columns]
        assert sorted(own.tolist()) == ids.tolist()
        for m, pixel in zip(own, found.pixels, strict=True):
            pixels = np.argwhere(mask == m)[:, ::-1] + 0.5
            nearest = np.linalg.norm(pixels - pixels.mean(axis=0), axis=1).min()
            assert np.linalg.norm(pixel - pixels.mean(axis=0)) == pytest.approx(nearest, abs=1e-9)
        gaps = np.linalg.norm(found.ground[:, None] - people[ids], axis=2)
        assert gaps.min(axis=1, initial=9.0).max(initial=0.0) < 1.2
        crowded += len(ids) > len(BlobDetector().detect(replace(frame, forest=None)).ground)
    assert crowded > 0  # some people have touching blobs, which are one


def test_segmentation_is_the_blob_detector_and_shows_no_numbers():
    rng = np.random.default_rng(1)
    for frame, mask, _ in shown(rng, OPEN, 1):
        mine, blobs = MaskDetector().detect(frame, mask), BlobDetector().detect(frame)
        if len(blobs.ground) == 1:
            np.testing.assert_allclose(mine.ground, blobs.ground, atol=1e-9)
            np.testing.assert_allclose(mine.covariances, blobs.covariances, atol=1e-12)
    rng = np.random.default_rng(2)
    for frame, mask, _ in shown(rng, OPEN, 5):
        renamed = np.where(mask >= 0, 4 - mask, -1)
        for name in ("ground", "pixels", "covariances"):
            one, other = (getattr(MaskDetector().detect(frame, m), name) for m in (mask, renamed))
            np.testing.assert_array_equal(one, other)
