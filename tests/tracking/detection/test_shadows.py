"""Shadows on the plane at people's mid-height, and what shows of a silhouette there, against lines of sight."""

import math

import numpy as np
import pytest
from helpers.covariance_fit import sample_forests
from helpers.poses import turned

from tracking.detection.blob_detector import BlobDetector
from tracking.detection.clearing import make_clearing
from tracking.detection.detector import Frame
from tracking.detection.partial_visibility import (
    PART_ERROR,
    _compute_deviances,
    _compute_moments,
    _make_grid,
    find_places,
)
from tracking.detection.shadows import _cut, add_shadows, find_openings, is_open
from tracking.detection.silhouette import compute_visible_moments, make_silhouette
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree

GREEN, ORANGE = (100, 115, 75), (230, 62, 0)


def views(rng, count):
    """Random cameras over random forests, and the clearing around what a random pixel of each shows."""
    for k in range(count):
        trees = tuple(Tree(*rng.uniform(-12, 12, 2), canopy_radius=rng.uniform(0.3, 3.0)) for _ in range(25))
        forest = Forest(trees, "disc" if k % 5 == 0 else "line_of_sight")
        camera = Camera(rng.uniform(0.5, 1.4), 128)
        quaternion = turned(rng.uniform(0, 0.5), rng.uniform(-math.pi, math.pi), rng.uniform(-math.pi, math.pi))
        pose = Pose(np.array([*rng.uniform(-5, 5, 2), rng.uniform(6.5, 22.0)]), quaternion)
        lens = camera.lens(pose)
        clearing = make_clearing(lens, tuple(rng.uniform(0, 128, 2).tolist()))
        yield camera, pose, forest, add_shadows(clearing, lens.eye, forest.blockers, 4.0)


def world(clearing, uv):
    x, y = clearing.away
    return np.array(clearing.origin) + uv @ np.array([[x, y], [-y, x]])


def seen(camera, pose, forest, points):
    points = np.column_stack([points, np.full(len(points), TARGET_HEIGHT)])
    return camera.sees(pose, points) & forest.visible(pose.position, points)[0]


def test_open_is_what_the_camera_has_a_line_of_sight_to():
    rng, hidden, total = np.random.default_rng(0), 0, 0
    for camera, pose, forest, clearing in views(rng, 150):
        uv = rng.uniform(-2.8, 2.8, (200, 2))
        expected = seen(camera, pose, forest, world(clearing, uv))
        assert [is_open(clearing, u, v) for u, v in uv] == expected.tolist()
        intervals = np.empty((len(clearing.shadows) + 1, 2))
        for (u, v), free in zip(uv, expected.tolist(), strict=True):
            inside = intervals[: find_openings(clearing, v, intervals)]
            assert np.any((inside[:, 0] <= u) & (u <= inside[:, 1])) == free
        hidden, total = hidden + np.sum(~expected), total + len(expected)
    assert 0.3 < hidden / total < 0.9


def test_footprints_are_what_pixels_cover_and_silhouettes_show_whole():
    for camera, pose, _, clearing in views(np.random.default_rng(1), 50):
        pixel = camera.project(pose, np.append(clearing.origin, TARGET_HEIGHT))[0]
        steps = 1e-4 * np.array([[1.0, 0.0], [0.0, 1.0]])
        moved = camera.ground_points(pose, pixel + steps, TARGET_HEIGHT) - clearing.origin
        x, y = clearing.away
        covered = (moved @ np.array([[x, -y], [y, x]])).T / 1e-4
        np.testing.assert_allclose(clearing.footprint, covered, rtol=1e-3, atol=1e-6)
    clearing = make_clearing(Camera(2.5, 512).lens(Pose.level(0.0, 0.0, 19.0)), (330.0, 210.0))
    silhouette = make_silhouette(clearing.distance, 19.0)
    area, along, across = (
        compute_visible_moments(clearing, silhouette, np.array([0.0, 0.7]), np.array([-0.3, 0.0])).reshape(-1, 3).T
    )
    np.testing.assert_allclose(area, silhouette.area, rtol=1e-9)
    np.testing.assert_allclose(along, silhouette.area * silhouette.middle, rtol=1e-9)
    np.testing.assert_allclose(across, 0.0, atol=1e-9)


def test_what_shows_is_what_lines_of_sight_leave_of_the_silhouette():
    rng, parts = np.random.default_rng(2), 0
    for camera, pose, forest, clearing in views(rng, 40):
        silhouette = make_silhouette(clearing.distance, float(pose.position[2]))
        uv = rng.uniform((silhouette.low, -silhouette.half), (silhouette.high, silhouette.half), (4000, 2))
        row = np.minimum(np.abs(uv[:, 1]) / silhouette.row, len(silhouette.cover) - 1).astype(int)
        column = ((uv[:, 0] - silhouette.low) / silhouette.bin).astype(int)
        weights = np.diff(silhouette.cover, axis=1)[row, column]
        at = rng.uniform(-0.5, 0.5, 2)
        free = weights * seen(camera, pose, forest, world(clearing, uv + at))
        area, along, across = compute_visible_moments(clearing, silhouette, at[:1], at[1:])[0, 0]
        assert area / silhouette.area == pytest.approx(free.sum() / weights.sum(), abs=0.05)
        if area > 0.2 * silhouette.area:
            np.testing.assert_allclose([along / area, across / area], free @ uv / free.sum(), atol=0.04)
            parts += area < 0.9 * silhouette.area
    assert parts > 5


def cut_person(camera):
    """Image of a person hidden in part by a canopy, and the forest with that canopy."""
    image = np.full((camera.pixels, camera.pixels, 3), GREEN, dtype=np.uint8)
    n = camera.pixels // 32
    image[15 * n : 17 * n, 22 * n + n // 2 : 23 * n + n // 4] = ORANGE
    return image, Forest((Tree(5.6, 0.0, 1.5),))


def test_turning_and_moving_camera_and_scene_turns_and_moves_the_place():
    camera = Camera(math.radians(60), 128)
    image, forest = cut_person(camera)
    pose = Pose.level(0.0, 0.0, 19.0)
    here = BlobDetector().detect(Frame(0, 0.0, camera, pose, image, forest))
    assert find_places(Frame(0, 0.0, camera, pose, image), np.array([[90.5, 62.5], [91.5, 62.5]]), forest) is not None
    for yaw, shift in ((0.3, (0.0, 0.0)), (1.7, (16.0, -8.0)), (-2.0, (-3.0, 5.0))):
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        trees = tuple(Tree(*(turn @ [t.x, t.y] + shift), t.canopy_radius) for t in forest.trees)
        away = Pose(pose.position + np.array([*shift, 0.0]), turned(0.0, 0.0, yaw))
        there = BlobDetector().detect(Frame(0, 0.0, camera, away, image, Forest(trees)))
        np.testing.assert_allclose(there.ground, here.ground @ turn.T + shift, atol=1e-9)
        np.testing.assert_allclose(there.covariances, turn @ here.covariances @ turn.T, atol=1e-9)


@pytest.mark.parametrize("pixels", [64, 128, 256, 512])
def test_the_number_of_places_does_not_depend_on_the_images_size(pixels):
    camera = Camera(math.radians(60), pixels)
    image, forest = cut_person(camera)
    frame = Frame(0, 0.0, camera, Pose.level(0.0, 0.0, 19.0), image)
    rows, columns = np.nonzero(image[:, :, 0] == ORANGE[0])
    places = find_places(frame, np.column_stack([columns + 0.5, rows + 0.5]), forest)
    assert 150 <= places.shares.size <= 200


def test_two_grids_agree_with_one_of_a_hundred_times_as_many_places():
    errors, spreads = [], []
    for s in sample_forests(3, 4):
        found = find_places(s.frame, s.blob, s.forest)
        if found is None:
            continue
        silhouette = make_silhouette(found.clearing.distance, float(s.frame.pose.position[2]))
        many = _make_grid(found.clearing, found.seen, silhouette, (-3.0, -2.0), (3.0, 2.0), 20000)
        (mean, covariance, _), (exact, exactly, _) = (
            _compute_moments(places, _compute_deviances(places, PART_ERROR)) for places in (found, many)
        )
        errors.append((mean - exact) @ np.linalg.solve(exactly, mean - exact))
        spreads.append(np.sqrt(np.trace(covariance) / np.trace(exactly)))
    assert len(errors) > 18
    assert np.mean(errors) < 0.1  # beside 2 by which truth differs
    assert 1.0 < np.mean(spreads) < 1.15


def test_what_shadows_leave_of_an_interval_is_what_they_leave_of_its_parts():
    """Ends that are equal, empty shadows and shadows beyond the interval included."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        intervals, count, left = np.empty((9, 2)), 1, set(range(12))
        intervals[0] = 0.0, 12.0
        for _ in range(8):
            low, high = np.sort(rng.integers(-3, 16, 2)).tolist()
            count = _cut(intervals, count, (float(low), float(high)))
            left -= set(range(low, high))
        parts = [part for a, b in intervals[:count].astype(int).tolist() for part in range(a, b)]
        assert sorted(parts) == sorted(left)
