"""Detections matched to rendered people, against all possible matchings."""

from itertools import permutations

import numpy as np
import pytest

from sim.sensing.detection_truth import GATE, count_visible_pixels, match_detections


def segmentation(*blobs, size=24):
    """Image (size, size) in which the k-th person shows at the pixels (row, column) of the k-th blob."""
    people = np.full((size, size), -1, dtype=np.int32)
    for k, pixels in enumerate(blobs):
        for row, column in pixels:
            people[row, column] = k
    return people


def brute_force(pixels, people, count):
    """The people of the matching with most pairs within the gate, and among those of the least total distance."""
    places = [np.argwhere(people == k)[:, ::-1] + 0.5 for k in range(count)]
    gap = np.array([[np.min(np.linalg.norm(p - uv, axis=1), initial=np.inf) for p in places] for uv in pixels])
    slots = [*range(count), *[None] * len(pixels)]
    best = (0, 0.0, frozenset())
    for chosen in set(permutations(slots, len(pixels))):
        pairs = [(gap[i, k], k) for i, k in enumerate(chosen) if k is not None]
        if all(d <= GATE for d, _ in pairs):
            candidate = (-len(pairs), sum(d for d, _ in pairs), frozenset(k for _, k in pairs))
            best = min(best, candidate, key=lambda b: b[:2])
    return [k in best[2] for k in range(count)]


def found_people(pixels, people, count):
    """List whether each person is found by a detection."""
    return (match_detections(pixels, people, count) >= 0).tolist()


def test_matches_equal_brute_force():
    rng = np.random.default_rng(0)
    outcomes = set()
    for _ in range(400):
        count, detections = rng.integers(1, 4), rng.integers(1, 4)
        centres = rng.integers(6, 14, (count, 2))
        people = segmentation(*[c + rng.integers(-1, 2, (4, 2)) for c in centres])
        pixels = rng.uniform(4, 16, (detections, 2))
        found = match_detections(pixels, people, count) >= 0
        assert found.tolist() == brute_force(pixels, people, count)
        outcomes.add((int(detections), int(found.sum())))
    assert outcomes == {(n, k) for n in (1, 2, 3) for k in range(n + 1)}


def test_matches_and_pixels_of_few_people_are_those_by_hand():
    people = segmentation([(10, 10)], [(10, 12)])
    assert found_people(np.array([[11.4, 10.5]]), people, 2) == [True, False]
    assert found_people(np.array([[11.4, 10.5], [11.4, 10.5]]), people, 2) == [True, True]
    people = segmentation([(10, 10)], [(13, 10)])
    assert found_people(np.array([[10.5, 10.5], [8.0, 10.8]]), people, 2) == [True, True]
    people = segmentation([(11, 11)], [(3, 3)])
    pixels = np.array([[11.5, 11.0], [19.0, 1.0], [3.0, 5.0]])
    assert match_detections(pixels, people, 3).tolist() == [0, 2, -1]
    people = segmentation([(0, 5)])  # in the first row
    for pixel, expected in (([5.5, -4.0], True), ([9.0, -4.0], False), ([5.5, 4.0], False)):
        assert found_people(np.array([pixel]), people, 1) == [expected]
    pixels = np.array([[5.5, -4.0], [5.4, 0.5]])
    assert found_people(pixels, segmentation([(0, 5)], [(1, 5)]), 2) == [True, True]
    assert found_people(np.array([[3.0, 3.0]]), segmentation(), 2) == [False, False]
    assert found_people(np.zeros((0, 2)), segmentation([(3, 3)]), 1) == [False]
    assert found_people(np.array([[3.0, 3.0]]), segmentation(), 0) == []
    people = segmentation([(1, 1), (1, 2)], [], [(4, 4), (4, 5), (9, 9)])
    assert count_visible_pixels(people, 4).tolist() == [2, 0, 3, 0]
    assert count_visible_pixels(segmentation(), 0).tolist() == []


@pytest.mark.parametrize(("distance", "expected"), [(GATE, True), (GATE + 1e-6, False)])
def test_the_gate_is_the_distance_to_the_nearest_pixel(distance, expected):
    people = segmentation([(5, 5), (5, 6), (5, 7)])
    assert found_people(np.array([[7.5 + distance, 5.5]]), people, 1) == [expected]
    assert found_people(np.array([[5.5 - distance, 5.5]]), people, 1) == [expected]
