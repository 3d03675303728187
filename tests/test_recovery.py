"""Which lost person somebody who turns up is taken for."""

import numpy as np
import pytest

from tracking.kalman import Gaussian
from tracking.recovery import recovered, sightings

TRACKS = np.array([[0.0, 0, 0, 0], [10.0, 0, 0, 0], [0.0, 10, 0, 0]]), np.tile(np.eye(4), (3, 1, 1))
SEEN = np.array([[0.0, 0, 8.0], [10.0, 0, 8.0], [0.0, 10, 8.0]])
ALL = np.ones(3, dtype=bool)


def born(x, y):
    return Gaussian(np.array([x, y, 0.0, 0.0]), 0.1 * np.eye(4))


def which(x, y, *, lost=ALL, now=10.0, tracks=TRACKS):
    return recovered(born(x, y), tracks, SEEN, lost, now=now, max_speed=3.0)


@pytest.mark.parametrize(("place", "expected"), [((1, 1), 0), ((8, 1), 1), ((1, 7), 2), ((4.9, 0), 0)])
def test_the_likeliest_lost_track_in_reach_is_taken(place, expected):
    assert which(*place) == expected


def test_nobody_is_recovered_who_cannot_have_got_there():
    assert which(-6.9, 0) == 0  # 2 s at 3 m/s, and 1 m of margin
    assert which(-7.1, 0) is None
    assert which(-7.1, 0, now=10.5) == 0


def test_only_lost_tracks_are_taken():
    assert which(1, 1, lost=np.array([False, True, True])) is None
    assert which(5, 1, lost=np.array([False, True, True])) == 1
    assert (
        recovered(
            born(0, 0),
            (np.zeros((0, 4)), np.zeros((0, 4, 4))),
            np.zeros((0, 3)),
            np.zeros(0, bool),
            now=1.0,
            max_speed=3.0,
        )
        is None
    )


def test_a_vague_belief_pays_for_its_vagueness():
    covariances = TRACKS[1].copy()
    covariances[1] *= 400.0
    # 4 standard deviations from the first, a fifth of one from the second, which might be anywhere.
    assert which(4.2, 0, tracks=(TRACKS[0], covariances)) == 1
    assert which(1.5, 0, tracks=(TRACKS[0], covariances)) == 0


def test_sightings_are_kept_while_a_track_is_unseen():
    now = np.array([[1.0, 1, 5.0], [2.0, 2, 5.0], [3.0, 3, 5.0]])
    before = {7: np.array([0.0, 0, 4.0]), 8: np.array([0.5, 0, 4.0])}
    kept = sightings([7, 8, 9], now, before, np.array([False, True, True]))
    np.testing.assert_array_equal(kept, [[1.0, 1, 5.0], [0.5, 0, 4.0], [3.0, 3, 5.0]])
    assert sightings([], np.zeros((0, 3)), before, np.zeros(0, bool)).shape == (0, 3)
