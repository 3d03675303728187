"""Fragments of people: joined as the plain rule says, and whole people kept whole by cameras of any tilt."""

import math

import numpy as np
import pytest
from helpers.frames import photographed
from helpers.poses import turned

from sim.sensing.detection_truth import match_detections
from tracking.detection.blob_detector import _is_one_person, _join
from tracking.detection.detector import Frame
from tracking.detection.person_size import sizes_at
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT

IMAGE = np.zeros((1, 1, 3), dtype=np.uint8)
CAMERA = Camera(math.radians(60), 128)


def tilted(tilt, yaw=0.0, altitude=19.0):
    """A camera's pose, tilted towards its image's top and turned [rad]."""
    return Pose(np.array([0.0, 0.0, altitude]), turned(tilt, 0.0, yaw))


def plainly_joined(frame, blobs, origins):
    """The nearest two that one person can span, all measured anew after each join."""
    blobs, origins = list(blobs), list(origins)
    lens = frame.camera.lens(frame.pose)
    while True:
        centres = np.array([blob.mean(axis=0) for blob in blobs])
        reach = np.linalg.norm(sizes_at(frame.camera.lens(frame.pose), centres).extents, axis=1)
        distances = np.linalg.norm(centres[:, None] - centres, axis=2)
        pairs = np.argwhere(np.triu(distances < reach, 1)).tolist()
        for i, j in sorted(pairs, key=lambda pair: (distances[tuple(pair)], pair)):
            both = np.vstack([blobs[i], blobs[j]])
            if _is_one_person(lens, both):
                origins[i] = origins[i if len(blobs[i]) >= len(blobs[j]) else j]
                blobs[i] = both
                del blobs[j], origins[j]
                break
        else:
            return blobs, origins


@pytest.mark.parametrize("tilt", [0.0, 0.8, 1.3])
def test_fragments_are_joined_nearest_first(tilt):
    rng = np.random.default_rng(0)
    joins = 0
    for count in (0, 1, 2, 40, 120):
        corners = rng.integers(0, 120, (count, 2))
        sizes = rng.integers(1, 4, count)
        blobs = [
            np.array([[x + dx, y + dy] for dy in range(n) for dx in range(2)]) + 0.5
            for (x, y), n in zip(corners, sizes, strict=True)
        ]
        frame = Frame(0, 0.0, CAMERA, tilted(tilt), IMAGE)
        found, origins = _join(frame.camera.lens(frame.pose), blobs, range(count))
        expected, theirs = plainly_joined(frame, blobs, range(count)) if count else ([], [])
        assert origins == theirs
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)
        joins += count - len(found)
    assert joins > 5


@pytest.mark.parametrize(("degrees", "size"), [(d, size) for d in (30, 45, 58) for size in (128, 512)])
def test_whole_people_near_corners_of_tilted_images_are_one_detection_each(degrees, size):
    """People of four pixels or more: of what is smaller, beside the horizon, rounding makes more than one's area."""
    rng, camera = np.random.default_rng(0), Camera(math.radians(60), size)
    counts = []
    with photographed() as shoot:
        for _ in range(50):
            pose = tilted(math.radians(degrees), rng.uniform(-3, 3), rng.uniform(14, 22))
            inset = rng.uniform(0.08, 0.2, 2) * size
            pixel = np.where(rng.random(2) < 0.5, inset, size - inset)
            place, heading = camera.ground_points(pose, pixel, TARGET_HEIGHT), rng.uniform(-math.pi, math.pi)
            rendered, found = shoot(pose, place, heading, camera)
            rows, columns = np.nonzero(rendered.people == 0)
            ends = np.array([rows, columns])
            if len(rows) >= 4 and ends.min() > 0 and ends.max() < size - 1:
                counts.append(len(found.ground))
    assert len(counts) > 15 and np.mean(np.array(counts) == 1) >= 0.99


def test_tilted_cameras_find_people_and_only_people():
    rng, camera = np.random.default_rng(1), Camera(math.radians(60), 256)
    people = found = detections = 0
    with photographed(people=3) as shoot:
        for _ in range(60):
            pose = tilted(rng.uniform(0.3, 0.8), rng.uniform(-3, 3), rng.uniform(14, 22))
            pixels = rng.uniform(0.05, 0.95, (3, 2)) * camera.pixels
            if min(np.linalg.norm(pixels[k] - pixels[k - 1]) for k in range(3)) < 50:
                continue
            places, headings = camera.ground_points(pose, pixels, TARGET_HEIGHT), rng.uniform(-math.pi, math.pi, 3)
            rendered, seen = shoot(pose, places, headings, camera)
            people, detections = people + 3, detections + len(seen.pixels)
            found += np.sum(match_detections(seen.pixels, rendered.people, 3) >= 0)
    assert people > 60 and found / people >= 0.98 and found / detections >= 0.98
