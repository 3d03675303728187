"""Fragments of people: joined as the plain rule says, and whole people kept whole by cameras of any tilt."""

import math

import numpy as np
import pytest

from tracking.camera import Camera, Pose
from tracking.detector import Frame, _joined, _one_person, sizes

IMAGE = np.zeros((1, 1, 3), dtype=np.uint8)
CAMERA = Camera(math.radians(60), 128)


def tilted(tilt, yaw=0.0, altitude=19.0):
    """A camera's pose, tilted towards its image's top and turned [rad]."""
    c, s, cy, sy = math.cos(tilt / 2), math.sin(tilt / 2), math.cos(yaw / 2), math.sin(yaw / 2)
    return Pose(np.array([0.0, 0.0, altitude]), np.array([s * cy, s * sy, c * sy, c * cy]))


def plainly_joined(frame, blobs, origins):
    """The nearest two that one person can span, all measured anew after each join."""
    blobs, origins = list(blobs), list(origins)
    lens = frame.camera.lens(frame.pose)
    while True:
        centres = np.array([blob.mean(axis=0) for blob in blobs])
        reach = np.linalg.norm(sizes(frame, centres).extents, axis=1)
        distances = np.linalg.norm(centres[:, None] - centres, axis=2)
        pairs = np.argwhere(np.triu(distances < reach, 1)).tolist()
        for i, j in sorted(pairs, key=lambda pair: (distances[tuple(pair)], pair)):
            both = np.vstack([blobs[i], blobs[j]])
            if _one_person(lens, both):
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
        blobs = [
            np.array([[x + 0.5 + dx, y + 0.5 + dy] for dy in range(rng.integers(1, 4)) for dx in range(2)])
            for x, y in corners
        ]
        frame = Frame(0, 0.0, CAMERA, tilted(tilt), IMAGE)
        found, origins = _joined(frame, blobs, range(count))
        expected, theirs = plainly_joined(frame, blobs, range(count)) if count else ([], [])
        assert origins == theirs
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)
        joins += count - len(found)
    assert joins > 5


def test_eight_hundred_fragments_are_measured_little_more_than_once(monkeypatch):
    """Each join measures one blob anew and each pair is tried once."""
    tried = []
    monkeypatch.setattr("tracking.detector._one_person", lambda lens, blob: tried.append(1) or _one_person(lens, blob))
    blobs = [pixel[None] + 0.5 for pixel in np.random.default_rng(1).integers(0, 128, (800, 2)).astype(float)]
    found, _ = _joined(Frame(0, 0.0, CAMERA, tilted(0.0), IMAGE), blobs, range(800))
    assert len(found) < 500
    assert len(tried) < 30 * 800
