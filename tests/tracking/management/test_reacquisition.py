"""Re-acquisition of lost tracks by new ones."""

import itertools
import math

import numpy as np
import pytest
from helpers.fleets import fleet, ids, play
from helpers.scenes import MOTION, track
from scipy.stats import multivariate_normal

from tracking.management.reacquisition import find_lost_tracks, match_lost_tracks, turned_density
from tracking.parameters import TrackerParameters


@pytest.mark.parametrize("seed", range(4))
def test_labels_go_to_new_tracks_as_in_the_best_of_all_assignments(seed):
    """As many lost people as possible are found again; among these assignments, in the likeliest way."""
    rng, several = np.random.default_rng(seed), 0
    for _ in range(50):
        new, lost = (random_tracks(rng, count) for count in rng.integers(0, 4, 2))
        seen = np.column_stack(
            [lost[0][:, :2] + rng.normal(size=(len(lost[0]), 2)), rng.uniform(5.0, 9.9, len(lost[0]))]
        )
        reach = 3.0 * (10.0 - seen[:, 2]) + 1.0
        near = np.linalg.norm(new[0][:, None, :2] - seen[:, :2], axis=2) <= reach
        cost = np.array([[-2.0 * log_density(a, b) for b in zip(*lost, strict=True)] for a in zip(*new, strict=True)])
        ways = [way for way in assignments(*near.shape) if all(near[pair] for pair in way)]
        best = min((-len(way), sum(cost[pair] for pair in way)) for way in ways)
        found = match_lost_tracks(new, lost, seen, now=10.0, max_speed=3.0)
        assert set(map(tuple, found)) in map(set, ways)
        assert (-len(found), sum(cost[pair] for pair in found)) == pytest.approx(best, abs=1e-9)
        several += len({(-len(way), sum(cost[pair] for pair in way)) for way in ways if -len(way) == best[0]}) > 1
    assert several > 5


def random_tracks(rng, count):
    roots = rng.normal(size=(count, 4, 4))
    return rng.normal(scale=5.0, size=(count, 4)), roots @ np.swapaxes(roots, 1, 2) + 0.1 * np.eye(4)


def log_density(one, other):
    """Of the difference of two positions, if both tracks are of one person."""
    return multivariate_normal(np.zeros(2), one[1][:2, :2] + other[1][:2, :2]).logpdf(one[0][:2] - other[0][:2])


def assignments(rows, columns):
    """All sets of pairs with each row and each column in one pair at most."""
    for count in range(min(rows, columns) + 1):
        for chosen in itertools.combinations(range(rows), count):
            for others in itertools.permutations(range(columns), count):
                yield tuple(zip(chosen, others, strict=True))


def test_people_never_sighted_or_just_now_are_not_lost():
    seen, p = np.array([[0.0, 0.0, time] for time in (-np.inf, np.nan, 9.8)]), TrackerParameters(MOTION)
    found = turned_density(seen, np.ones(3), np.zeros((1, 2)), np.eye(2)[None], (9.8, 10.0), p.loss)
    assert found.tolist() == [0.0] and find_lost_tracks(seen, 9.8, p).tolist() == []
    assert find_lost_tracks(seen, 10.0, p).tolist() == [2]


def test_lost_people_after_a_turn_are_about_their_last_places():
    rng = np.random.default_rng(0)
    sightings = np.column_stack([rng.uniform(-9, 9, (5, 2)), 10.0 - rng.uniform(0.5, 20.0, 5)])
    existence, z, roots = rng.uniform(0.1, 1.0, 5), rng.uniform(-9, 9, (7, 2)), rng.normal(size=(7, 2, 2))
    noise = roots @ np.swapaxes(roots, 1, 2) + 0.02 * np.eye(2)
    expected = [
        sum(
            r
            * (1 - math.exp((t - 10.0) / 10))
            * multivariate_normal((x, y), (1.5 * (10.0 - t)) ** 2 * np.eye(2) + R).pdf(p)
            for (x, y, t), r in zip(sightings, existence, strict=True)
        )
        for p, R in zip(z, noise, strict=True)
    ]
    found = turned_density(sightings, existence, z, noise, (9.8, 10.0), TrackerParameters(MOTION).loss)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("fusion", ["kla", "hcmci"])
def test_a_person_found_at_the_edge_of_the_gate_and_beyond_has_one_track(fusion):
    """Unseen for 2 s, a person turned. One UAV has a measurement 3.4 deviations off, another one beyond the gate."""
    trackers = fleet(2, track(3, -6.0, 0.0, 1.0, 0.0), fusion=fusion)
    both, counts = ~np.eye(2, dtype=bool), []
    play(trackers, 0, [[(-6.0, 0.0)]] * 2, both)
    for k in range(1, 11):
        play(trackers, k, [None, None], both)
    mean, P = trackers[0].tracks[0].belief.mean, trackers[0].tracks[0].belief.covariance
    place = mean[:2] + np.array([0.0, 3.4 * math.sqrt(P[1, 1] + 0.05)])
    beyond = place + np.array([0.0, 1.5])
    play(trackers, 11, [None, [beyond]], both)
    play(trackers, 12, [[place], [beyond]], both)
    for k in range(13, 25):
        play(trackers, k, [None, [beyond]], both)
        counts.append(len(trackers[0].tracks))
    assert counts == [1] * 12 and ids(trackers) == [(3,)] * 2, counts
