"""Correspondence, identity switches and fragmentations, by cases made by hand."""

import math

import numpy as np
import pytest

from tracking.metrics.clearmot import count_fragmentations, count_switches, find_correspondence


def line(*xs):
    """A path along the x axis; None where it is absent."""
    return [(math.nan, math.nan) if x is None else (x, 0.0) for x in xs]


def paths(*rows):
    return np.moveaxis(np.array(rows, dtype=float), 0, 1)


# People and tracks by their x at each scan; expected matches, switches and fragmentations. The gate is 1 m.
CASES = {
    "one track all the time": ([line(0, 1, 2)], [line(0.1, 1.2, 2.3)], [[0], [0], [0]], [0], [0]),
    "none": ([line(0, 1)], [line(5, 6)], [[-1], [-1]], [0], [0]),
    "another id takes over": ([line(0, 0, 0)], [line(0, None, None), line(None, 0, 0)], [[0], [1], [1]], [1], [0]),
    "another id after a gap": (
        [line(0, 0, 0, 0)],
        [line(0, None, None, None), line(None, None, 0, 0)],
        [[0], [-1], [1], [1]],
        [1],
        [1],
    ),
    "the same id after a gap": ([line(0, 0, 0)], [line(0, 3, 0)], [[0], [-1], [0]], [0], [1]),
    # After the gap the last track is 0.8 m off, and another one 0.1 m.
    "somebody nearer after a gap": (
        [line(0, 0, 0, 0)],
        [line(0.8, 3, 0.8, 0.8), line(9, 9, 0.1, 0.1)],
        [[0], [-1], [0], [0]],
        [0],
        [1],
    ),
    "somebody nearer after an absence": (
        [line(0, None, 0)],
        [line(0.8, 0.8, 0.8), line(9, 9, 0.1)],
        [[0], [-1], [0]],
        [0],
        [0],
    ),
    "lost for good": ([line(0, 0, 0)], [line(0, 3, 3)], [[0], [-1], [-1]], [0], [0]),
    "found late": ([line(0, 0, 0)], [line(3, 0, 0)], [[-1], [0], [0]], [0], [0]),
    "there and back": (
        [line(0, 0, 0)],
        [line(0, None, 0), line(None, 0.5, 0.1)],
        [[0], [1], [1]],  # a third scan with both: what stands for the person stays
        [1],
        [0],
    ),
    "an absence is no fragmentation": ([line(0, None, 0)], [line(0, 9, 0)], [[0], [-1], [0]], [0], [0]),
    # The tracks pass each other 0.4 m from both people; a new assignment would swap them, and none is made.
    "continuity before distance": (
        [line(0, 0, 0), line(0.8, 0.8, 0.8)],
        [line(0, 0.6, 0), line(0.8, 0.2, 0.8)],
        [[0, 1], [0, 1], [0, 1]],
        [0, 0],
        [0, 0],
    ),
    "tracks that swap people": ([line(0, 0), line(5, 5)], [line(0, 5), line(5, 0)], [[0, 1], [1, 0]], [1, 1], [0, 0]),
    # Nearest first would leave the second person without a track.
    "as many pairs as can be": ([line(0), line(0.9)], [line(0.8), line(-0.5)], [[1, 0]], [0, 0], [0, 0]),
    # Both had track 0; the second had it later and keeps it, though the first is nearer.
    "the later correspondence": (
        [line(0, 0, 0), line(5, 5, 0.9)],
        [line(0, 5, 0.4)],
        [[0, -1], [-1, 0], [-1, 0]],
        [0, 0],
        [0, 0],
    ),
    "the same id after a gap, beside somebody with another": (
        [line(0, 0, 0), line(5, 0.9, 0.9)],
        [line(0, None, 0.2), line(9, 9, 9), line(None, 0.9, None)],
        [[0, -1], [-1, 2], [0, -1]],
        [0, 0],
        [1, 0],
    ),
}


@pytest.mark.parametrize(("people", "tracks", "matches", "switched", "broken"), CASES.values(), ids=CASES)
def test_matches_switches_and_fragmentations_are_those_counted_by_hand(people, tracks, matches, switched, broken):
    people = paths(*people)
    found = find_correspondence(paths(*tracks), people, 1.0)
    assert found.tolist() == matches and count_switches(found).tolist() == switched
    assert count_fragmentations(found, ~np.isnan(people[..., 0])).tolist() == broken


def test_order_does_not_matter_and_invalid_arguments_are_refused():
    rng = np.random.default_rng(1)
    for _ in range(30):
        tracks, people = np.cumsum(rng.normal(0, 0.5, (20, 7, 2)), axis=0), np.cumsum(rng.normal(0, 0.5, (20, 5, 2)), 0)
        a, b = rng.permutation(7), rng.permutation(5)
        found, again = find_correspondence(tracks, people, 1.0), find_correspondence(tracks[:, a], people[:, b], 1.0)
        assert np.array_equal(np.where(again >= 0, a[again], -1), found[:, b])
    with pytest.raises(ValueError, match="within must be positive, is 0"):
        find_correspondence(np.zeros((1, 1, 2)), np.zeros((1, 1, 2)), 0.0)
    with pytest.raises(ValueError, match=r"are \(2, 1, 2\) and \(1, 1, 2\)"):
        find_correspondence(np.zeros((2, 1, 2)), np.zeros((1, 1, 2)), 1.0)
