import math

import cv2
import numpy as np
import pytest
from helpers.frames import Tally, frame, photographed, survey
from helpers.poses import turned
from helpers.views import CAMERA, random_forest

from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from tracking.detection.blob_detector import BlobDetector, find_blobs
from tracking.detection.components import find_components
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree

GREEN = (100, 115, 75)


def blank():
    return np.full((128, 128, 3), GREEN, dtype=np.uint8)


@pytest.mark.parametrize("frames", [80, pytest.param(250, marks=pytest.mark.slow)])
def test_people_and_only_people_are_found_where_they_are(frames):
    """In four forests, with so many frames each; 80 tell a bias of 3 cm from none at every angle."""
    rng = np.random.default_rng(0)
    tally = Tally([], [])
    for count, radius in ((20, 5.0), (60, 1.0), (28, 4.0), (20, 5.0)):
        survey(tally, rng, random_forest(rng, count, radius), frames)
    people = np.array(tally.people, dtype=float)
    assert len(people) > 12 * frames and np.mean(people[:, 0]) >= 0.99 and np.mean(tally.detections) >= 0.99
    for low in range(0, 40, 5):
        errors = people[(people[:, 1] >= low) & (people[:, 1] < low + 5) & (people[:, 0] == 1), 2:]
        assert len(errors) > frames / 5
        assert np.abs(errors.mean(axis=0)).max() < 0.03, f"{low} degrees: {errors.mean(axis=0)}"
        assert errors.std(axis=0).max() < 0.12


def test_all_pixels_of_people_and_nothing_else_have_a_persons_colour():
    rng = np.random.default_rng(0)
    uavs = tuple(Uav(start=tuple(rng.uniform(-20, 20, 2)), footprint=10.0) for _ in range(10))
    with photographed(0, random_forest(rng, 40, 3.0), Scenario(uavs=uavs)) as shoot:
        for _ in range(30):
            _, found = shoot(Pose.level(*rng.uniform(-30, 30, 2), 21.7), np.zeros((0, 2)), np.zeros(0))
            assert found.pixels.shape == (0, 2) and found.ground.shape == (0, 2)
    rng = np.random.default_rng(0)
    with photographed() as shoot:
        for _ in range(50):
            place, heading = rng.uniform(-8, 8, 2), rng.uniform(-math.pi, math.pi)
            pose = Pose.level(0.0, 0.0, 19.0)
            rendered, found = shoot(pose, place, heading)
            rows, columns = np.nonzero(rendered.people == 0)
            (blob,), _ = find_blobs(frame(rendered.image, pose, CAMERA))
            assert sorted(blob.tolist()) == sorted((np.column_stack([columns, rows]) + 0.5).tolist())
            assert found.pixels[0] == pytest.approx([columns.mean() + 0.5, rows.mean() + 0.5])


def test_single_pixels_are_detected_below_the_horizon_each_time_alike():
    image = blank()
    image[40, 90] = (230, 62, 0)
    pose = Pose.level(1.0, 2.0, 19.0)
    found = BlobDetector().detect(frame(image, pose))
    assert found.pixels.tolist() == [[90.5, 40.5]]
    assert found.ground == pytest.approx(CAMERA.ground_points(pose, np.array([[90.5, 40.5]]), TARGET_HEIGHT))
    image = blank()
    image[30:34, 61:63] = image[100:104, 61:63] = (230, 62, 0)
    level = Pose(np.array([0.0, 0.0, 10.0]), np.array([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]))
    found = BlobDetector().detect(frame(image, level))
    assert found.pixels == pytest.approx(np.array([[62.0, 102.0]])) and found.ground[0, 1] > 0
    image = blank()
    image[20:24, 30:33] = image[80:84, 32:36] = image[80:84, 38:41] = (230, 62, 0)
    before = image.tobytes()
    one, other = (BlobDetector().detect(frame(image, Pose.level(0.0, 0.0, 19.0))) for _ in range(2))
    assert one.ground.tobytes() == other.ground.tobytes() and image.tobytes() == before and len(one.ground) == 3


def test_a_person_cut_in_two_by_a_trunk_is_one_person():
    pose = Pose.level(0.0, 0.0, 19.0)
    with photographed() as shoot:
        for heading in np.linspace(-math.pi, math.pi, 12):
            rendered, _ = shoot(pose, [8.0, -6.0], heading)
            row = int(np.nonzero(rendered.people == 0)[0].mean())
            image = rendered.image.copy()
            image[row] = GREEN
            mask = (rendered.people == 0).astype(np.uint8)
            mask[row] = 0
            assert cv2.connectedComponents(mask)[0] - 1 >= 2
            found = BlobDetector().detect(frame(image, pose))
            assert len(found.ground) == 1 and found.ground[0] == pytest.approx([8.0, -6.0], abs=0.2)


@pytest.mark.parametrize(("trees", "lowest", "widest"), [(0, 0.9, 3.0), (16, 6.5, 2.6)])
def test_any_image_from_any_camera_gives_finite_places_and_positive_covariances(trees, lowest, widest):
    rng = np.random.default_rng(0)
    forest = Forest(tuple(Tree(*rng.uniform(-15, 15, 2), 1.5) for _ in range(trees)))
    count = 0
    for _ in range(25):
        camera = Camera(rng.uniform(0.2, widest), int(rng.choice([16, 32])))
        turn = turned(rng.uniform(0, 1.6), rng.uniform(-math.pi, math.pi))
        pose = Pose(np.array([1.0, 2.0, rng.uniform(lowest, 20.0)]), turn)
        image = np.full((camera.pixels, camera.pixels, 3), GREEN, dtype=np.uint8)
        image[rng.random(image.shape[:2]) < rng.choice([0.01, 0.1] if trees else [0.01, 0.1, 0.4])] = (230, 62, 0)
        found = BlobDetector().detect(frame(image, pose, camera, forest))
        assert np.isfinite(found.ground).all() and np.linalg.eigvalsh(found.covariances).min(initial=1.0) > 0.0
        count += len(found.ground)
    assert count > 50


def test_components_are_those_that_opencv_finds_by_colour():
    rng = np.random.default_rng(9)
    for density in (0.0, 1e-4, 0.003, 0.02, 0.1, 0.4):
        for size in (128, 127) * 6:
            image = rng.integers(0, 256, (size, size, 3)).astype(np.uint8)
            image[rng.random((size, size)) >= density] = GREEN
            red, green, blue = np.moveaxis(image.astype(int), 2, 0)
            mask = (2 * red > 3 * green) & (red > 2 * blue) & (red - green >= 20)
            _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
            sure = np.unique(labels[mask & (red - green >= 40)])
            found = find_components(image)
            assert len(found) == len(sure)
            for k, blob in zip(sure, found, strict=True):
                rows, columns = np.nonzero(labels == k)
                np.testing.assert_array_equal(blob, np.column_stack([columns + 0.5, rows + 0.5]))
