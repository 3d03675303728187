"""Track management by m of n scans and by existence probabilities."""

import math

import numpy as np
import pytest
from helpers.scenes import ALONE, AWAY, CAMERA, play, scan, track, tracker

from tracking.filter.mean_reverting import MeanRevertingVelocity
from tracking.fusion.consensus import fuse
from tracking.fusion.message import IDS_PER_SCAN, new_id
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.parameters import TrackerParameters
from tracking.tracker import Tracker

BOTH = pytest.mark.parametrize("management", ["m_of_n", "existence"])
EDGE = (20.0 - 0.85) * math.tan(math.radians(30))  # of the field of view, at a person's height [m]
PAIR = np.ones((2, 2), bool)


@BOTH
def test_a_person_that_turns_under_a_canopy_keeps_the_id(management):
    subject = tracker(track(3, -4, 0, 1.5, 0, variance=0.01), forest=Forest((Tree(0, 0, 5.0),)), management=management)
    play(subject, [scan(k) for k in range(17)])
    ids = play(subject, [scan(k, (0.0, 5.4 + 0.3 * (k - 17))) for k in range(17, 22)])
    assert ids[-1] == (3,)
    np.testing.assert_allclose(subject.tracks[0].belief.mean[:2], [0.0, 6.6], atol=0.3)


def test_of_more_births_than_labels_the_rest_begins_in_the_next_scan():
    subject, half = tracker(management="m_of_n", confirm=(1, 1)), IDS_PER_SCAN // 2
    places = [(float(k % 25 - 12) * 0.8, float(k // 25 - 12) * 0.8) for k in range(half + 3)]
    first, second = play(subject, [scan(k, *places) for k in range(2)])
    assert first == tuple(new_id(1, 0, k) for k in range(half))
    assert second == (*first, *(new_id(2, 0, k) for k in range(3)))


@pytest.mark.parametrize(("misses", "confirmed"), [(1, True), (2, False)])
def test_a_tentative_track_ends_after_two_misses_in_plain_view(misses, confirmed):
    """Each divides its odds, 5 at first, by 100; it ends below 0.001 of its first existence."""
    subject = tracker(clutter_density=2e-6, confirmation_threshold=0.9)
    ids = play(subject, [scan(0, (0, 0)), *(scan(k + 1) for k in range(misses)), scan(misses + 1, (0, 0))])
    assert bool(ids[-1]) == confirmed


def test_the_second_without_a_measurement_begins_again_with_each():
    """Of three measurements a second apart, the third confirms."""
    subject = tracker(clutter_density=2e-4)
    ids = play(subject, [scan(k, (0, 0)) if k % 5 == 0 else scan(k, pose=AWAY) for k in range(11)])
    assert [bool(held) for held in ids] == [False] * 10 + [True]


@pytest.mark.parametrize(("clutter", "confirmed"), [(0.2, True), (2.0, False)])
def test_a_measurement_that_is_more_likely_clutter_is_no_hit(clutter, confirmed):
    """A second measurement at the first has density 1 / (2π 0.19 m²): it is the track's with 0.81 or 0.29."""
    subject = tracker(management="m_of_n", confirm=(2, 2), clutter_density=clutter, detection_probability=0.5)
    assert bool(play(subject, [scan(k, (0, 0)) for k in range(2)])[-1]) == confirmed


def test_a_person_with_a_track_gets_no_second_one():
    """Counting scans leaves the existence of both at 1, so that they would not be merged."""
    subject = tracker(track(3, 0, 0, 0, 0), management="m_of_n")
    assert play(subject, [scan(k, (0, 0)) for k in range(6)]) == [(3,)] * 6


@BOTH
def test_two_people_detected_at_once_get_two_lasting_tracks(management):
    rng = np.random.default_rng(1)
    subject = tracker(management=management)
    people = [np.array([[-3 + 0.2 * k, 0.0], [3 - 0.2 * k, 4.0]]) for k in range(25)]
    ids = play(subject, [scan(k, *(p + rng.normal(scale=0.15, size=(2, 2)))) for k, p in enumerate(people)])
    assert ids[1:] == [(2_000_000, 2_000_001)] * 24
    assert all((t.existence == 1.0) == (management == "m_of_n") for t in subject.tracks)


@BOTH
@pytest.mark.parametrize(("place", "counts"), [((EDGE, 0), False), ((EDGE, EDGE), False), ((EDGE - 1.0, 0), True)])
def test_only_scans_that_should_have_shown_the_person_count(place, counts, management):
    """At the edge half of the belief is in view, at the corner a quarter, a metre inside all of it."""
    subject = tracker(track(3, *place, 0, 0, variance=0.01), negative_information=0.0, management=management)
    ids = play(subject, [scan(k) for k in range(5)])
    assert ids[3] == (3,) and (ids[4] == ()) == counts


def test_scans_without_a_frame_count_neither_way():
    subject = tracker(track(3, 0, 0, 0, 0))
    for k in range(9):
        if k % 2:
            subject.coast(0.2 * k)
        else:
            subject.step(scan(k))
        fuse([subject], ALONE, 5)
        assert [t.id for t in subject.tracks] == ([3] if k < 8 else [])  # the fifth frame is that of the ninth scan


def test_scans_without_a_frame_leave_what_the_frame_before_showed():
    """Of a belief of which half is in view, a frame each second tells the same with and without scans between."""
    found = []
    for coasts in (True, False):
        subject = tracker(track(3, EDGE, 0, 0, 0, variance=4.0))
        for k in range(11):
            if k % 5 == 0:
                subject.step(scan(k))
            elif coasts:
                subject.coast(0.2 * k)
            if coasts or k % 5 == 0:
                fuse([subject], ALONE, 5)
        found.append(subject.tracks[0].belief)
    np.testing.assert_allclose(found[0].mean, found[1].mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found[0].covariance, found[1].covariance, rtol=1e-9, atol=1e-9)


def test_only_sure_detections_tell_how_fast_people_walk():
    """Of two tracks in one place each may be the person's. Tracks known at the start are as good as seen then."""
    motion, moving = MeanRevertingVelocity(0.2, 0.5, walking_speed=1.0), track(3, 0, 0, 3, 0)
    for others, learns in ((), True), ((track(4, 0, 0, 3, 0),), False):
        subject = Tracker(0, CAMERA, TrackerParameters(motion), (moving, *others))
        play(subject, [scan(0)])
        first = subject.motion.walking_speed
        play(subject, [scan(1, (0.6, 0))])
        assert (subject.motion.walking_speed > first) == learns


def test_misses_of_two_uavs_in_one_scan_count_once_and_a_hit_cancels_them():
    trackers = [tracker(track(3, 0, 0, 0, 0), uav=u, management="m_of_n") for u in range(2)]
    for k in range(10):
        for u, t in enumerate(trackers):
            t.step(scan(k, *([(0, 0)] if (u, k) == (1, 4) else []), uav=u))
        fuse(trackers, PAIR, 5)
        assert [len(t.tracks) for t in trackers] == [int(k < 9)] * 2


def test_a_look_without_a_detection_tells_nothing_where_another_uav_detects_the_person():
    """UAV 1's frame shows half of the belief, in which UAV 0 measures the person; no frame shows another person."""
    found, hidden = [], track(4, -60, 0, 0, 0)
    for looks in (True, False):
        trackers = [tracker(track(3, EDGE, 0, 0, 0, variance=4.0), hidden, uav=u) for u in range(2)]
        trackers[0].step(scan(0, (EDGE, 0), pose=Pose.level(EDGE, 0.0, 20.0)))
        if looks:
            trackers[1].step(scan(0, uav=1))
        else:
            trackers[1].coast(0.0)
        fuse(trackers, PAIR, 5)
        found.append(trackers[1].tracks[0].belief)
    np.testing.assert_allclose(found[0].mean, found[1].mean, atol=1e-3)
    np.testing.assert_allclose(found[0].covariance, found[1].covariance, atol=1e-3)


def test_a_frame_that_the_association_has_used_is_not_sent():
    for points, used in ([(EDGE, 0)], True), ([], False):
        subject = tracker(track(3, EDGE, 0, 0, 0))
        subject.step(scan(0, *points))
        assert (subject.message(0).views[0, 0] == 0) == used
