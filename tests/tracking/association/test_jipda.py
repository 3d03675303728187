"""Existence of people: against Musicki's recursion for one track and brute force for several."""

import itertools
import math

import numpy as np
import pytest
from helpers.fleets import fleet
from helpers.graphs import graph
from helpers.kalman import update
from helpers.scenes import ABOVE, AWAY, MOTION, play, scan, track, tracker

from tracking.association.jpda import existence_association, from_log_odds, gated_likelihood, log_odds
from tracking.filter.kalman import Gaussian
from tracking.fusion.consensus import fuse
from tracking.geometry.visibility import Forest, Tree
from tracking.settings import DAY
from tracking.track import Track

R = 0.05 * np.eye(2)
PLAIN = 0.99 * 0.9999  # detected, and in the gate


def maybe(r: float, *state: float, id: int = 3, variance: float = 0.05) -> Track:
    return Track(id, Gaussian(np.array(state, float), variance * np.eye(4)), r)


def brute_force(likelihood, detection, clutter, existence):
    """Association probabilities beta and existence r by enumeration of joint events and sets of existing tracks."""
    T, N = likelihood.shape
    beta, given, total = np.zeros((T, N + 1)), np.zeros((T, N + 1)), 0.0
    for there in itertools.product([False, True], repeat=T):
        for event in itertools.product(*(range(N + 1) if e else [0] for e in there)):
            used = [j for j in event if j]
            if len(set(used)) < len(used):
                continue
            weight = math.prod(r if e else 1 - r for r, e in zip(existence, there, strict=True))
            for i, j in enumerate(event):
                if there[i]:
                    weight *= detection[i, j] * likelihood[i, j - 1] / clutter if j else 1 - detection[i, 0]
            total += weight
            for i, j in enumerate(event):
                beta[i, j] += weight
                given[i, j] += weight * there[i]
    return beta / total, given / given.sum(axis=1, keepdims=True), given.sum(axis=1) / total


@pytest.mark.parametrize("density", [0.3, 1.0])
def test_marginals_are_those_of_all_events_and_all_sets_of_people(density):
    rng = np.random.default_rng(0)
    for _ in range(60):
        T, N = rng.integers(1, 5, 2)
        likelihood = 10 ** rng.uniform(-4, 0, (T, N)) * (rng.random((T, N)) < density)
        detection = rng.random((T, N + 1)) * (rng.random((T, 1)) < 2 / 3)
        case = likelihood, detection, 10 ** rng.uniform(-5, 0), rng.uniform(0.01, 0.99, T)
        for ours, exact in zip(existence_association(*case), brute_force(*case), strict=True):
            np.testing.assert_allclose(ours, exact, rtol=1e-9, atol=1e-14)


def test_one_track_follows_musickis_recursion():
    """Integrated PDA: r (1 - d) / (1 - d r), with d = P_D P_G - P_D P_G sum of likelihood / clutter density."""
    rng = np.random.default_rng(1)
    for _ in range(100):
        likelihood, r = 10 ** rng.uniform(-6, 0, (1, int(rng.integers(0, 5)))), rng.uniform(0.01, 0.99)
        p, clutter = rng.uniform(0, 0.99), 10 ** rng.uniform(-5, 0)
        beta, given, after = existence_association(
            likelihood, np.full((1, likelihood.size + 1), p), clutter, np.array([r])
        )
        d = p - p * likelihood.sum() / clutter
        assert after[0] == pytest.approx((1 - d) * r / (1 - d * r), rel=1e-12)
        assert given[0, 0] == pytest.approx((1 - p) / (1 - d), rel=1e-12)  # PDA's, whatever r is
        np.testing.assert_allclose(given[0, 1:], p * likelihood[0] / clutter / (1 - d), rtol=1e-12)
        assert beta[0, 0] == pytest.approx((1 - p * r) / (1 - d * r), rel=1e-12)


def test_a_tracker_follows_the_recursion_over_hits_and_misses():
    subject = tracker(
        maybe(0.6, 0, 0, 1, 0),
        management="existence",
        survival=0.98,
        clutter_density=0.01,
        negative_information=0.0,
        reacquire_after=DAY,
    )
    belief, r = maybe(0.6, 0, 0, 1, 0).belief, 0.6
    for k, seen in enumerate([True, False, False, True, False, True, True]):
        z = np.array([0.2 * k + 0.1, 0.05])
        play(subject, [scan(k, *([z] if seen else []))])
        if k:
            belief, r = MOTION.predict(belief), r * 0.98**0.2
        d = PLAIN
        if seen:
            d -= (
                PLAIN
                * gated_likelihood(belief.mean[None], belief.covariance[None], z[None], R[None], 0.9999)[0, 0]
                / 0.01
            )
        assert subject.tracks[0].existence == pytest.approx((1 - d) * r / (1 - d * r), rel=1e-6)
        r = subject.tracks[0].existence
        if seen:
            belief = mixed(belief, update(belief, z, R), (1 - PLAIN) / (1 - d))
        np.testing.assert_allclose(subject.tracks[0].belief.mean, belief.mean, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(subject.tracks[0].belief.covariance, belief.covariance, rtol=1e-6, atol=1e-9)


def mixed(missed: Gaussian, hit: Gaussian, weight: float) -> Gaussian:
    """Two components as one Gaussian."""
    gap = hit.mean - missed.mean
    spread = weight * (1 - weight) * np.outer(gap, gap)
    covariance = weight * missed.covariance + (1 - weight) * hit.covariance + spread
    return Gaussian(missed.mean + (1 - weight) * gap, covariance)


def test_certain_people_are_associated_as_by_jpda():
    rng = np.random.default_rng(2)
    likelihood, detection = 10 ** rng.uniform(-4, 0, (4, 4)), rng.uniform(0, 0.99, (4, 5))
    jpda, given, after = existence_association(likelihood, detection, 0.01, np.ones(4))
    np.testing.assert_array_equal(given, jpda)
    np.testing.assert_array_equal(after, 1.0)
    for nearly, certain in zip(
        existence_association(likelihood, detection, 0.01, np.full(4, 1 - 1e-12)), (jpda, jpda, after), strict=True
    ):
        np.testing.assert_allclose(nearly, certain, rtol=1e-9)


def test_log_odds_and_back_stay_finite_and_counting_says_nothing_of_existence():
    r = np.array([1e-8, 0.2, 0.5, 1 - 1e-8])
    np.testing.assert_allclose([from_log_odds(log_odds(each)) for each in r], r, rtol=1e-12)
    assert np.isfinite([log_odds(0.0), log_odds(1.0)]).all()
    counted = tracker(track(3, 0, 0, 0, 0), management="m_of_n")
    play(counted, [scan(k) for k in range(4)])
    assert [t.existence for t in counted.tracks] == [1.0]


@pytest.mark.parametrize(("survival", "left"), [(1.0, 0.9), (0.99, 0.9 * 0.99**20)])
def test_a_person_hidden_for_twenty_seconds_exists_as_survival_says(survival, left):
    trees = Forest((Tree(0, 0, 90.0),))
    settings = {"management": "existence", "survival": survival, "max_variance": 400.0}
    subject = tracker(maybe(0.9, -1, 0, 0.1, 0), forest=trees, **settings)
    assert play(subject, [scan(k) for k in range(101)])[-1] == (3,)
    assert subject.tracks[0].existence == pytest.approx(left, rel=1e-9)
    away = tracker(maybe(0.9, 0, 0, 0.1, 0), **settings)
    play(away, [scan(k, pose=AWAY) for k in range(41)])
    assert away.tracks[0].existence == pytest.approx(0.9 * survival**8, rel=1e-9)


@pytest.mark.parametrize("radius", [2.0, 5.0])
def test_the_track_of_a_person_under_a_watched_canopy_is_not_deleted(radius):
    """The belief reaches beyond the edge and is pushed back: only what it should have shown counts."""
    subject = tracker(
        track(3, -1, 0, 1.5, 0), forest=Forest((Tree(0, 0, radius),)), management="existence", survival=1.0
    )
    assert play(subject, [scan(k) for k in range(101)])[-1] == (3,) and subject.tracks[0].existence > 0.9


@pytest.mark.parametrize(("detection", "scans"), [(0.99, 4), (0.9, 7), (0.5, 23)])
def test_an_empty_place_in_plain_view_ends_a_track_when_the_odds_say_so(detection, scans):
    """From a log-odds of 9: each miss multiplies the odds by 1 - P_D, down to 1 : 999."""
    r = from_log_odds(9.0)
    settings = {"management": "existence", "survival": 1.0, "detection_probability": detection, "max_variance": 1e6}
    ids = play(tracker(maybe(r, 0, 0, 0, 0), **settings), [scan(k) for k in range(25)])
    assert ids.index(()) == math.ceil((9 + math.log(999)) / -math.log(1 - detection * 0.9999)) - 1 == scans - 1


def test_half_a_belief_in_view_lowers_existence_by_half_the_probability_of_detection():
    # The mean lies on the border of the field of view, the plane of sight at a person's height.
    edge = (20.0 - 0.85) * math.tan(math.radians(30))
    subject = tracker(maybe(0.5, edge, 0, 0, 0), management="existence", survival=1.0)
    play(subject, [scan(0)])
    assert subject.tracks[0].existence == pytest.approx((1 - PLAIN / 2) / (2 - PLAIN / 2), rel=1e-6)


def test_tentative_tracks_are_confirmed_unless_clutter_explains_them_or_forgotten():
    few, many = ({"management": "existence", "clutter_density": c} for c in (1e-6, 1e-2))
    scans = [scan(k, (0.2 * k, 1.0)) for k in range(8)]
    assert play(tracker(**few), scans).index((2_000_000,)) == 1
    assert 2 <= next(k for k, ids in enumerate(play(tracker(**many), scans)) if ids) <= 4
    # Newcomers likelier than clutter by far are believed at sight.
    assert play(tracker(management="existence", birth_density=1e-3), scans)[0] != ()
    subject = tracker(management="existence")
    scans = [scan(0, (0, 0)), *(scan(k, pose=AWAY) for k in range(1, 7)), scan(7, (0.1, 0))]
    assert play(subject, scans) == [()] * 8
    waited = tracker(management="existence")
    assert play(waited, [scan(0, (0, 0)), *(scan(k, pose=AWAY) for k in range(1, 4)), scan(4, (0.1, 0))])[-1] != ()


def cluttered(seed: int, **settings) -> tuple[int, int]:
    """Scans in which ghosts are held and in which people are missed, of 150 with half a false alarm each on 480 m²."""
    rng = np.random.default_rng(seed)
    subject = tracker(clutter_density=1e-3, detection_probability=0.9, **settings)
    false = missed = 0
    for k in range(150):
        walkers = np.array([[5 * math.sin(0.04 * k), 5 * math.cos(0.04 * k)], [-6 + 0.08 * k, 0.0]])
        z = walkers[rng.random(len(walkers)) < 0.9]
        z = z + rng.multivariate_normal(np.zeros(2), R, len(z))
        alarms = rng.uniform(-11, 11, (rng.poisson(0.48), 2))
        ids = play(subject, [scan(k, *z, *alarms)])[-1]
        places = np.array([t.belief.mean[:2] for t in subject.tracks]).reshape(-1, 2)
        gaps = np.linalg.norm(places[:, None] - walkers, axis=2)
        false += len(ids) - int((gaps < 2.0).any(axis=1).sum())
        missed += int((~(gaps < 2.0).any(axis=0)).sum())
    return false, missed


def test_ghosts_are_fewer_than_by_counting_scans_and_die():
    counted = np.array([cluttered(seed, management="m_of_n") for seed in range(4)]).sum(axis=0)
    existing = np.array([cluttered(seed, management="existence") for seed in range(4)]).sum(axis=0)
    assert counted[0] > 50 and existing[0] <= 5
    assert existing[1] - counted[1] <= 2 * 4 * 2  # two people, four runs, at most two scans each
    subject = tracker(
        maybe(0.999, 0, 0, 0, 0), maybe(0.999, 7, 7, 1, 0, id=4), management="existence", clutter_density=1e-3
    )
    rng = np.random.default_rng(3)
    held = play(subject, [scan(k, *rng.uniform(-11, 11, (rng.poisson(0.48), 2))) for k in range(40)])
    assert held[-1] == ()


def test_the_fleet_begins_and_ends_tracks_by_the_average_of_log_odds():
    trackers = fleet(2, maybe(0.9, 0, 0, 0, 0), survival=1.0)
    for u, t in enumerate(trackers):
        t.step(scan(0, *([(0.0, 0.05)] if u == 0 else []), uav=u))
    messages = [t.message(1) for t in trackers]
    weights, odds = (np.array([m.shares[0, c] for m in messages]) for c in (0, 21))
    fuse(trackers, np.ones((2, 2), bool), 1)
    for t in trackers:
        assert log_odds(t.tracks[0].existence) == pytest.approx(odds.sum() / weights.sum(), rel=1e-9)
    assert weights[1] < 2e-4 * weights[0]  # one saw the person, so the other's empty place is a miss
    trackers = fleet(4, maybe(0.999, 0, 0, 0, 0))
    for k in range(20):
        for u, t in enumerate(trackers):
            t.step(scan(k, *([(6.0, 0.1 * k)] if u == 1 and k > 9 else []), uav=u, pose=ABOVE if u in (1, 3) else AWAY))
        fuse(trackers, graph("line", 4), 5)
        assert len({tuple(t.id for t in s.tracks) for s in trackers}) == 1
        assert len(trackers[0].tracks) == int(k < 3 or k > 10)
