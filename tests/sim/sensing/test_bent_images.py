"""Images through lenses that bend: sampled from straight ones, with people where the model has them."""

import math

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.numerics.distances import squared_distance

BARREL = Camera.calibrated(160, 120, (140.0, 138.0), (82.0, 59.0), (-0.3, 0.09, 0.001, -0.001))
PINCUSHION = Camera.calibrated(320, 180, (240.0, 240.0), (160.0, 91.0), (0.14, -0.2, 0.0005, 0.0005, 0.1))
LARGE = Camera.calibrated(400, 300, (350.0, 350.0), (200.0, 150.0), (-0.25, 0.05))
PEOPLE = 8
SCENARIO = Scenario(uavs=(Uav(start=(74.0, 49.0)),))


def views(camera: Camera, rng: np.random.Generator, frames: int):
    """Poses, level and tilted in turn, and people (8, 2) m at least 2.5 m apart all over the image."""
    for k in range(frames):
        sway = rng.uniform(-15, 15, 2) if k % 2 else (0.0, 0.0)
        turn = Rotation.from_euler("ZYX", [rng.uniform(-180, 180), *sway], degrees=True).as_quat()
        pose = Pose(np.array([0.0, 0.0, 20.0]), turn)
        people = np.empty((0, 2))
        while len(people) < PEOPLE:
            place = camera.ground_points(pose, rng.uniform(0, camera.size, (1, 2)), TARGET_HEIGHT)
            if np.all(np.hypot(*(people - place).T) > 2.5):
                people = np.vstack([people, place])
        yield pose, people


@pytest.mark.parametrize("frames", [150, pytest.param(400, marks=pytest.mark.slow)])
@pytest.mark.parametrize("camera", [BARREL, PINCUSHION, LARGE], ids=["barrel", "pincushion", "large"])
def test_detections_in_bent_images_are_unbiased_on_the_ground(camera, frames):
    """Of 150 frames a mean error of 3 cm is three standard errors in each ring of the image, of 400 five."""
    rng, detector, rows = np.random.default_rng(1), BlobDetector(), []
    with World(SCENARIO, Forest(()), PEOPLE) as world:
        renderer = Renderer(world)
        for pose, people in views(camera, rng, frames):
            world.place_people(people, rng.uniform(-math.pi, math.pi, PEOPLE))
            found = detector.detect(Frame(0, 0.0, camera, pose, renderer.render(camera, pose).image, Forest(())))
            gaps = np.linalg.norm(found.ground[:, None] - people, axis=2)
            near = gaps.min(axis=1) < 1.5
            error = (found.ground - people[gaps.argmin(axis=1)])[near]
            away = (people[gaps.argmin(axis=1)] - pose.position[:2])[near]
            away /= np.linalg.norm(away, axis=1)[:, None]
            along = np.sum(error * away, axis=1)
            across = error[:, 1] * away[:, 0] - error[:, 0] * away[:, 1]
            off = np.abs(found.pixels[near] / camera.size - 0.5).max(axis=1)
            nees = squared_distance(error, found.covariances[near]) / 2
            rows.append(np.column_stack([error, along, across, off, nees]))
    table = np.concatenate(rows)
    assert len(table) > 0.9 * frames * PEOPLE
    for inner, outer in ((0.0, 0.25), (0.25, 0.4), (0.4, 0.6)):
        part = table[(table[:, 4] >= inner) & (table[:, 4] < outer)]
        assert len(part) > 0.75 * frames
        np.testing.assert_allclose(part[:, :4].mean(axis=0), 0.0, atol=0.03)
    assert 0.85 < table[:, 5].mean() < 1.2


def test_a_bent_image_shows_what_a_straight_one_shows_at_the_same_rays():
    rng = np.random.default_rng(2)
    fine = Camera.calibrated(1600, 1200, (1400.0, 1380.0), (800.0, 600.0))
    with World(SCENARIO, Forest(()), PEOPLE) as world:
        renderer = Renderer(world)
        for pose, people in views(BARREL, rng, 4):
            world.place_people(people, rng.uniform(-math.pi, math.pi, PEOPLE))
            bent, straight = renderer.render(BARREL, pose), renderer.render(fine, pose)
            v, u = np.mgrid[0:120, 0:160] + 0.5
            points = np.column_stack(
                [BARREL.ground_points(pose, np.column_stack([u.ravel(), v.ravel()])), np.zeros(19200)]
            )
            column, row = np.floor(fine.project(pose, points)[0]).astype(int).T
            inside = (column >= 0) & (column < 1600) & (row >= 0) & (row < 1200)
            # Sampling moves rims by up to a sixth of a pixel, which is 1.5 pixels of the fine image.
            low, high = (
                find(straight.people, 7)[row[inside], column[inside]] for find in (minimum_filter, maximum_filter)
            )
            np.testing.assert_array_equal(bent.people.ravel()[inside][low == high], low[low == high])
            mask = straight.people[row[inside], column[inside]]
            assert np.sum(mask[low == high] >= 0) > 20
            colour = straight.image[row[inside], column[inside]].astype(int)
            both = (mask < 0) & (bent.people.ravel()[inside] < 0)
            assert np.abs(colour - bent.image.reshape(-1, 3)[inside])[both].mean() < 2.0


def test_rectangular_straight_images_agree_with_square_ones():
    square = Camera(math.radians(60), 128)
    with World(SCENARIO, Forest(()), PEOPLE) as world:
        renderer = Renderer(world)
        for pose, people in views(square, np.random.default_rng(3), 4):
            world.place_people(people, np.zeros(PEOPLE))
            whole = renderer.render(square, pose)
            part = Camera.calibrated(100, 60, (square.focal, square.focal), (64.0 - 10, 64.0 - 50))
            shown = renderer.render(part, pose)
            assert shown.image.shape == (60, 100, 3)
            np.testing.assert_array_equal(shown.people, whole.people[50:110, 10:110])
            np.testing.assert_array_equal(shown.image, whole.image[50:110, 10:110])
