"""One tracker: birth, coasting and end of tracks."""

import numpy as np
import pytest
from helpers.scenes import ABOVE, AWAY, MOTION, R, play, scan, track, tracker

from tracking.filter.kalman import Gaussian
from tracking.geometry.visibility import Forest, Tree
from tracking.track import Track


def test_initial_tracks_are_predicted_and_coast_while_hidden():
    subject = tracker(track(3, 1, 2, 1, 0), forest=Forest((Tree(0, 0, 8),)))
    play(subject, [scan(0)])
    np.testing.assert_allclose(subject.tracks[0].belief.mean, [1, 2, 1, 0], atol=1e-12)
    play(subject, [scan(1)])
    np.testing.assert_allclose(subject.tracks[0].belief.mean, [1.2, 2, 1, 0], atol=1e-12)
    play(subject, [scan(4)])  # two scans were lost
    np.testing.assert_allclose(subject.tracks[0].belief.mean, [1.8, 2, 1, 0], atol=1e-12)
    subject = tracker(track(3, -1, 0, 0.1, 0), forest=Forest((Tree(0, 0, 90.0),)), max_variance=400.0)
    assert play(subject, [scan(k) for k in range(101)]) == [(3,)] * 101
    belief = track(3, -1, 0, 0.1, 0).belief
    for _ in range(100):
        belief = MOTION.predict(belief)
    np.testing.assert_allclose(subject.tracks[0].belief.mean, belief.mean, rtol=1e-8)
    np.testing.assert_allclose(subject.tracks[0].belief.covariance, belief.covariance, rtol=1e-8, atol=1e-10)


def test_m_of_n_scans_that_should_have_shown_the_person_end_a_track():
    assert (
        play(tracker(track(3, 0, 0, 0, 0), management="m_of_n"), [scan(k) for k in range(6)]) == [(3,)] * 4 + [()] * 2
    )
    assert play(tracker(track(3, 0, 0, 0, 0)), [scan(k, pose=AWAY) for k in range(30)])[-1] == (3,)
    poses = [ABOVE] * 4 + [AWAY] * 10 + [ABOVE]
    ids = play(tracker(track(3, 0, 0, 0, 0), management="m_of_n"), [scan(k, pose=pose) for k, pose in enumerate(poses)])
    assert ids == [(3,)] * 14 + [()]
    seen = {4}
    subject = tracker(track(3, 0, 0, 0, 0), management="m_of_n")
    ids = play(subject, [scan(k, *([(0, 0)] if k in seen else [])) for k in range(10)])
    assert ids == [(3,)] * 9 + [()]
    scans = [scan(k, *([(0, 0)] if k % 2 else [])) for k in range(10)]  # miss, hit, miss, hit, miss
    assert play(tracker(track(3, 0, 0, 0, 0), delete=(3, 5), management="m_of_n"), scans).index(()) == 4
    assert play(tracker(track(3, 0, 0, 0, 0), delete=(3, 4), management="m_of_n"), scans)[-1] == (3,)


@pytest.mark.parametrize(
    ("hits", "confirmed_at"),
    [((0, 1), 1), ((0, 2), 2), ((0, 3), None), ((0,), None), ((0, 3, 6), None), ((0, 3, 5), 5)],
)
def test_a_track_is_confirmed_by_two_hits_in_three_scans(hits, confirmed_at):
    subject = tracker(management="m_of_n")
    ids = play(subject, [scan(k, *([(0.3 * k, 1)] if k in hits else [])) for k in range(8)])
    assert next((k for k, held in enumerate(ids) if held), None) == confirmed_at


def test_walkers_become_tracks_with_a_velocity_and_isolated_alarms_none():
    subject = tracker()
    play(subject, [scan(k, (-3 + 0.4 * k, 0.2 * k)) for k in range(12)])
    assert len(subject.tracks) == 1
    np.testing.assert_allclose(subject.tracks[0].belief.mean, [1.4, 2.2, 2, 1], atol=0.15)
    rng = np.random.default_rng(1)
    subject = tracker()
    corners = np.array([[-8, -8], [8, 8], [-8, 8], [8, -8.0]])
    scans = [scan(k, corners[k % 4] + rng.uniform(-1, 1, 2)) for k in range(100)]
    assert play(subject, scans) == [()] * 100


@pytest.mark.parametrize("speed", [0.0, 1.5, 3.0])
def test_people_at_any_walking_speed_are_picked_up_in_two_scans(speed):
    rng = np.random.default_rng(0)
    found = 0
    for _ in range(100):
        noise = rng.multivariate_normal(np.zeros(2), R, 2)
        found += bool(play(tracker(), [scan(0, noise[0]), scan(1, noise[1] + [0.2 * speed, 0])])[1])
    assert found >= 95


def crossing(k: int) -> np.ndarray:
    """Two people that meet after 4 s at 60 degrees, 1.4 m/s each."""
    t = 0.2 * k - 4
    return np.array([[1.21 * t, 0.7 * t], [1.21 * t, -0.7 * t]])


def test_people_merged_in_the_image_while_they_cross_keep_two_tracks():
    rng = np.random.default_rng(3)
    subject = tracker(track(1, *crossing(0)[0], 1.21, 0.7), track(2, *crossing(0)[1], 1.21, -0.7))
    for k in range(41):
        people = crossing(k)
        merged = np.linalg.norm(people[0] - people[1]) < 0.8  # for five scans one measurement in between
        z = people.mean(axis=0)[None] if merged else people
        assert play(subject, [scan(k, *(z + rng.normal(scale=0.1, size=z.shape)))]) == [(1, 2)]
    np.testing.assert_allclose([t.belief.mean[:2] for t in subject.tracks], crossing(40), atol=0.5)


def test_people_side_by_side_stay_two():
    rng = np.random.default_rng(4)
    subject = tracker(track(4, -5, 0, 1, 0), track(9, -5, 0.6, 1, 0))
    steps = [np.array([[-5 + 0.2 * k, 0], [-5 + 0.2 * k, 0.6]]) for k in range(60)]
    scans = [scan(k, *(s + rng.normal(scale=0.1, size=(2, 2)))) for k, s in enumerate(steps)]
    assert play(subject, scans)[-1] == (4, 9)


def test_a_person_that_appears_earlier_than_predicted_is_detected_at_once():
    # The track believes its person under the canopy, with no point of the belief in view.
    subject = tracker(track(3, 0, 0, 0, 0, variance=0.3), forest=Forest((Tree(0, 0, 1.2),)))
    play(subject, [scan(0, (1.6, 0))])
    assert [t.id for t in subject.tracks] == [3] and subject.tracks[0].belief.mean[0] > 1.2


def test_a_newcomer_in_the_gate_of_a_vague_belief_gets_a_track():
    """The hidden person may be anywhere under the tree and beyond: where the newcomer is, false alarms are likelier."""
    vague = Track(3, Gaussian(np.zeros(4), np.diag([90.0, 90.0, 0.04, 0.04])))
    subject = tracker(vague, forest=Forest((Tree(0, 0, 8.0),)), clutter_density=1e-2, max_variance=400.0)
    ids = play(subject, [scan(k, (9.5, 3.0 + 0.1 * k)) for k in range(4)])
    assert ids == [(3,)] * 3 + [(3, 4_000_000)]
    hidden, newcomer = (t.belief for t in subject.tracks)
    np.testing.assert_allclose(newcomer.mean[:2], [9.5, 3.3], atol=0.2)
    assert np.linalg.norm(hidden.mean[:2]) < 8.0 and np.trace(hidden.covariance[:2, :2]) > 100.0


def test_lost_tracks_take_no_new_people_and_end_at_very_large_covariance():
    subject = tracker(track(3, 70, 0, 0, 0, variance=100.0), max_variance=400.0)
    ids = play(subject, [scan(k, (0.2 * k, 0)) for k in range(4)])
    assert len(ids[-1]) == 2
    newcomer = subject.tracks[1].belief
    np.testing.assert_allclose(newcomer.mean, [0.6, 0, 1, 0], atol=0.4)
    subject = tracker(track(3, 70, 0, 0, 0, variance=150.0), max_variance=400.0)
    sizes = [len(ids) for ids in play(subject, [scan(k) for k in range(40)])]
    # tr P = 300 + 300 t² m² and little more reaches 400 m² after 0.58 s, at the third scan after the first.
    assert sizes == [1] * 3 + [0] * 37


@pytest.mark.parametrize(
    ("build", "complaint"),
    [
        (lambda: tracker(track(1, 0, 0, 0, 0), track(1, 1, 0, 0, 0)), r"ids of tracks are there twice: \[1\]"),
        (lambda: tracker(track(-1, 0, 0, 0, 0)), "ids of tracks are below 0"),
        (lambda: tracker(track(1_000_000, 0, 0, 0, 0)), "ids of initial tracks"),
        (lambda: tracker(uav=-1), "uav must be in"),
        (lambda: tracker().step(scan(0, uav=1)), "a scan of UAV 1"),
    ],
)
def test_invalid_scans_and_tracks_are_refused(build, complaint):
    with pytest.raises(ValueError, match=complaint):
        build()
