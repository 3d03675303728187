"""Healing of a split fleet: misses, new tracks, and validation of graphs and members."""

import re

import numpy as np
import pytest
from helpers.fleets import HALVES, WHOLE, fleet, ids, play
from helpers.scenes import ABOVE, AWAY, scan, track, tracker

from tracking.fusion.consensus import fuse
from tracking.geometry.visibility import Forest, Tree

PAIR = np.ones((2, 2), bool)


def test_misses_of_a_split_do_not_count_against_a_track_seen_elsewhere():
    trackers = fleet(2, track(3, 0, 0, 0, 0), management="m_of_n")
    for k in range(8):
        seen = [(0.0, 0.0)]
        looks = (seen if k <= 4 else None), (seen if k == 0 or k >= 6 else [])
        for t, points in zip(trackers, looks, strict=True):
            t.step(scan(k, *(points or []), uav=t.uav, pose=AWAY if points is None else ABOVE))
        fuse(trackers, np.eye(2, dtype=bool) if 1 <= k <= 4 else PAIR, 5)
        assert ids(trackers) == [(3,), (3,)]


def test_a_relabelled_track_does_not_take_a_hidden_persons_track():
    trees = Forest((Tree(0.0, 0.0, 3.0),))
    trackers = [
        tracker(track(3, -6 if u < 2 else 6, 0, 0, 0), track(4, 0, 0, 0, 0), uav=u, forest=trees) for u in range(4)
    ]
    for k in range(14):
        both = [[(-6, 0), (6, 0)]] * 4
        play(trackers, k, both if k >= 11 else [[(-6, 0)]] * 2 + [[(6, 0)]] * 2, WHOLE if k >= 11 else HALVES)
        if k >= 11:
            places = [[t.belief.mean[:2].round(1).tolist() for t in s.tracks] for s in trackers]
            assert places == [[[-6.0, 0.0], [0.0, 0.0], [6.0, 0.0]]] * 4
            assert len(set(ids(trackers))) == 1 and ids(trackers)[0][:2] == (3, 4)


def test_people_are_found_if_every_miss_makes_a_track_lost():
    trackers = fleet(1, reacquire_after=0.0)
    for k in range(6):
        trackers[0].step(scan(k, (0, 0), (5, 5)))
        fuse(trackers, np.zeros((1, 1), bool), 5)
    assert len(trackers[0].tracks) == 2


@pytest.mark.parametrize(
    ("adjacency", "rounds", "lost", "complaint"),
    [
        (np.ones((3, 3), bool), 5, None, "adjacency must be bool (2, 2), is bool (3, 3)"),
        (np.ones((2, 2)), 5, None, "adjacency must be bool (2, 2), is float64 (2, 2)"),
        (np.triu(PAIR), 5, None, "adjacency must be symmetric"),
        (PAIR, -1, None, "rounds must be a whole number of at least 0, is -1"),
        (PAIR, 2, np.zeros((1, 2, 2), bool), "lost must have shape (2, 2, 2), has (1, 2, 2)"),
    ],
)
def test_what_is_no_graph_is_refused(adjacency, rounds, lost, complaint):
    with pytest.raises(ValueError, match=re.escape(complaint)):
        fuse(fleet(2), adjacency, rounds, lost)


def test_members_of_one_number_or_with_different_settings_are_refused():
    for other, complaint in (
        (tracker(), "uav must differ among members"),
        (tracker(uav=1, fusion="kla"), "fusion must be"),
    ):
        with pytest.raises(ValueError, match=complaint):
            fuse([tracker(), other], PAIR, 5)


def test_messages_of_different_scans_are_refused():
    one, other = fleet(2)
    one.step(scan(0))
    one.step(scan(1))
    other.step(scan(1, uav=1))
    with pytest.raises(ValueError, match=r"messages must be of one scan, are of scans"):
        fuse([one, other], PAIR, 5)
