"""Tracks that share one person: one of them ends within two seconds, and a lost one turns up elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.fleets import fleet, ids
from helpers.scenes import AWAY, R, play, scan, track, tracker

from tracking.filter.kalman import Gaussian
from tracking.fusion.consensus import fuse
from tracking.fusion.message import new_id
from tracking.geometry.visibility import Forest, Tree
from tracking.management.deletion import find_duplicates, find_outcompeted
from tracking.track import Track

PAIR = np.ones((2, 2), bool)


def test_pairs_that_share_a_person_are_near_and_add_up_to_one():
    means = np.zeros((4, 4))
    means[3, 0] = 9.0
    beliefs, all_of_them = (means, np.tile(0.1 * np.eye(4), (4, 1, 1))), np.ones(4, bool)
    assert find_duplicates(beliefs, np.array([0.6, 0.95, 0.7, 0.5]), all_of_them, 20.0) == [(0, 2)]
    assert find_duplicates(beliefs, np.ones(4), all_of_them, 20.0) == []
    # The likelier by far is kept; a track is in one pair, with the nearest.
    assert find_duplicates(beliefs, np.array([0.2, 1.0, 1.0, 0.2]), all_of_them, 20.0) == [(1, 0)]
    means[1, 0], means[2, 0] = 0.3, 0.5
    assert find_duplicates(beliefs, np.array([0.6, 0.7, 0.7, 0.5]), all_of_them, 20.0) == [(1, 2)]
    assert find_duplicates(beliefs, np.array([0.6, 0.7, 0.7, 0.5]), np.arange(4) != 1, 20.0) == [(0, 2)]


@pytest.mark.parametrize("faint", [0.3, 0.002])
def test_a_faint_track_beside_a_certain_one_takes_neither_its_id_nor_its_belief(faint):
    vague = Track(3, Gaussian(np.array([0.5, 0, 0, 0]), np.diag([30.0, 30, 1, 1])), faint)
    subject = tracker(vague, track(4, 0, 0, 0, 0))
    assert all(4 in ids for ids in play(subject, [scan(k, (0, 0)) for k in range(8)]))
    assert [t.id for t in subject.tracks] == [4] and np.trace(subject.tracks[0].belief.covariance) < 1.0


@pytest.mark.parametrize(("last", "left"), [(5, [4, 5]), (new_id(1, 0, 0), [3, 4])])
def test_the_likelier_of_two_tracks_takes_the_older_id_only_if_it_is_new(last, left):
    one, other = (Gaussian(np.array([x, 0, 0, 0]), 0.05 * np.eye(4)) for x in (0.0, 9.0))
    subject = tracker(Track(3, one, 0.2), Track(4, other, 1.0), Track(5, one, 0.7))
    subject.step(scan(0, pose=AWAY))
    said = subject.message(0)  # all three are told as detected in this scan
    subject.accept(replace(said, ids=np.array([3, 4, last]), times=np.zeros((3, 4))))
    assert [t.id for t in subject.tracks] == left
    joint = next(t for t in subject.tracks if t.id != 4)
    assert joint.belief.mean[0] == pytest.approx(0.0) and joint.existence == pytest.approx(0.9, abs=1e-3)


@pytest.mark.parametrize(("begun", "left"), [(3, 3), (2, new_id(2, 0, 0))])
def test_a_track_takes_an_older_id_up_to_a_second_after_its_first_scan(begun, left):
    place = Gaussian(np.zeros(4), 0.05 * np.eye(4))
    subject = tracker(Track(3, place, 0.2), Track(4, place, 0.7))
    for k in range(7):
        subject.coast(0.2 * k)
        fuse([subject], np.zeros((1, 1), bool), 5)
    subject.coast(0.2 * 7)  # the eighth scan
    said = subject.message(0)
    subject.accept(replace(said, ids=np.array([3, new_id(begun, 0, 0)]), times=np.full((2, 4), said.time)))
    assert [t.id for t in subject.tracks] == [left]


def test_a_track_that_ends_takes_no_other_track_of_its_person_along():
    """The first track would be kept of the two, but is too uncertain to live on."""
    wide, narrow = (Gaussian(np.zeros(4), variance * np.eye(4)) for variance in (60.0, 1.0))
    subject = tracker(Track(3, wide, 0.7), Track(4, narrow, 0.7))
    subject.step(scan(0, pose=AWAY))
    said = subject.message(0)  # both are told as detected in this scan
    subject.accept(replace(said, times=np.zeros((2, 4))))
    assert [t.id for t in subject.tracks] == [4] and subject.tracks[0].existence == pytest.approx(0.7, abs=1e-3)


def test_a_joint_track_exists_for_certain_at_most():
    place = Gaussian(np.zeros(4), 0.05 * np.eye(4))
    subject = tracker(Track(3, place, 0.7), Track(4, place, 0.7))
    subject.step(scan(0, pose=AWAY))
    subject.accept(replace(subject.message(0), times=np.zeros((2, 4))))
    assert [(t.id, t.existence) for t in subject.tracks] == [(3, 1.0)]


def shared_for(seed: int, **settings) -> float:
    """Seconds for which two UAVs that measure one person with noise hold two tracks of this person; at most ten."""
    trackers, rng = fleet(2, track(3, 0, 0.1, 1, 0), track(4, 0, -0.1, 1, 0), **settings), np.random.default_rng(seed)
    for k in range(50):
        for t in trackers:
            t.step(scan(k, rng.multivariate_normal((0.2 * k, 0.0), R), uav=t.uav))
        fuse(trackers, PAIR, 5)
        if all(len(held) == 1 for held in ids(trackers)):
            return 0.2 * k
    return 10.0


def test_one_of_two_noisy_tracks_of_a_person_ends_within_two_seconds():
    times = np.array([shared_for(seed) for seed in range(60)])
    assert np.median(times) < 1.3 and times.max() < 2.1
    times = np.array([shared_for(seed, management="m_of_n") for seed in range(60)])
    assert np.median(times) < 0.9 and times.max() < 10.0


def test_a_measurement_is_a_hit_of_one_track():
    gates = np.array([[0, 0], [1, 0], [2, 1], [3, 1], [4, 2], [5, 3], [5, 4], [6, 4], [6, 3]])
    detected = np.array([0.5, 0.5, 0.1, 0.8, 0.99, 0.97, 0.96, 0.0])
    assert find_outcompeted(gates, detected).tolist() == [False, True, True] + [False] * 5
    assert find_outcompeted(np.zeros((0, 2), dtype=int), np.zeros(2)).tolist() == [False, False]
    # Of three tracks and two measurements one goes without.
    gates, detected = np.array([[0, 0], [1, 0], [1, 1], [2, 1]]), np.array([0.55, 0.7, 0.7])
    assert find_outcompeted(gates, detected).tolist() == [False, True, False]


@pytest.mark.parametrize("radius", [1.5, 3.0])
def test_two_people_under_one_canopy_stay_two(radius):
    """Their beliefs agree and their existence falls, but there is no measurement for which they compete."""
    hidden = track(3, -0.3, 0, 0, 0), track(4, 0.3, 0, 0, 0)
    subject = tracker(*hidden, forest=Forest((Tree(0, 0, radius),)))
    found = scan(0, (-0.3, 0), (0.3, 0))
    assert play(subject, [found, *(scan(k) for k in range(1, 100))]) == [(3, 4)] * 100
    assert sum(t.existence for t in subject.tracks) < 1.5


def test_a_lost_track_that_takes_a_neighbours_measurements_starves_nobody():
    """Person 3 goes under a tree and stands; person 4 passes it. Both come out as themselves."""
    subject = tracker(
        track(3, -3.0, 0, 1.0, 0), track(4, -3.0, -2.6, 1.0, 0), forest=Forest((Tree(0, 0, 2.0),)), reacquire_after=0.2
    )
    rng, held = np.random.default_rng(5), []
    for k in range(60):
        first = min(-3.0 + 0.2 * k, 0.0) + max(0.0, 0.2 * (k - 40))
        people = np.array([[first, 0.0], [-3.0 + 0.2 * k, -2.6]])
        seen = people[np.linalg.norm(people, axis=1) > 2.3]
        held += play(subject, [scan(k, *(seen + rng.normal(0, 0.1, seen.shape)))])
    assert set(held) == {(3, 4)}
    np.testing.assert_allclose([t.belief.mean[:2] for t in subject.tracks], people, atol=0.4)


def test_a_lost_track_takes_its_own_person_up_again_or_a_known_one_stays():
    """Tracks 3 and 4 are where one person is; the other turns up some metres away."""
    subject = tracker(track(3, 0, 0, 0, 0), track(4, 0.2, 0, 0, 0))
    scans = [scan(k, (0.1, 0), *([(3.0, 2.0)] if k > 3 else [])) for k in range(12)]
    assert play(subject, scans) == [(3, 4)] * 12
    assert sorted(t.belief.mean[0].round() for t in subject.tracks) == [0.0, 3.0]
    subject = tracker(track(3, 0, 0, 0, 0, variance=0.01), forest=Forest((Tree(0, 0, 3.0),)))
    play(subject, [scan(5000 + k, (7.5, 0)) for k in range(4)])
    assert len(subject.tracks) == 2 and subject.tracks[0].id == 3
