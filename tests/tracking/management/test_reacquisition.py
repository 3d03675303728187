"""Re-acquisition of lost tracks by new ones."""

import numpy as np
import pytest

from tracking.management.reacquisition import reacquisitions

LOST = np.array([[0.0, 0, 0, 0], [10.0, 0, 0, 0], [0.0, 10, 0, 0]]), np.tile(np.eye(4), (3, 1, 1))
SEEN = np.array([[0.0, 0, 8.0], [10.0, 0, 8.0], [0.0, 10, 8.0]])


def pairs(*places, lost=LOST, seen=SEEN, now=10.0):
    means = np.array([[x, y, 0.0, 0.0] for x, y in places]).reshape(-1, 4)
    born = means, np.tile(0.1 * np.eye(4), (len(means), 1, 1))
    return reacquisitions(born, lost, seen, now=now, max_speed=3.0)


@pytest.mark.parametrize(("place", "expected"), [((1, 1), 0), ((8, 1), 1), ((1, 7), 2), ((4.9, 0), 0)])
def test_the_likeliest_lost_track_in_reach_is_taken(place, expected):
    assert pairs(place) == [(0, expected)]


def test_tracks_in_reach_are_reacquired_unless_vague():
    assert pairs((-6.9, 0)) == [(0, 0)]  # 2 s at 3 m/s, and 1 m of margin
    assert pairs((-7.1, 0)) == [] and pairs((-7.1, 0), now=10.5) == [(0, 0)]
    covariances = LOST[1].copy()
    covariances[1] *= 400.0
    # 4 standard deviations from the first, a third of one from the second, which might be anywhere.
    assert pairs((4.2, 0), lost=(LOST[0], covariances)) == [(0, 1)]
    assert pairs((1.5, 0), lost=(LOST[0], covariances)) == [(0, 0)]


def test_two_new_tracks_are_two_people():
    assert pairs((4.0, 0), (1.0, 0)) == [(0, 1), (1, 0)]
    assert pairs((4.0, 0), (1.0, 0), lost=(LOST[0][:1], LOST[1][:1]), seen=SEEN[:1]) == [(1, 0)]
    # Both are nearest to the first; only the first of them can have reached the second.
    assert pairs((4.0, 0), (-1.0, 0)) == [(0, 1), (1, 0)]
