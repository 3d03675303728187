"""Reported tracks: the choice with the least expected GOSPA, by enumeration of all choices and of who exists."""

from itertools import product

import numpy as np
import pytest

from tracking.filter.kalman import Gaussian
from tracking.metrics.gospa import gospa
from tracking.track import Track, are_reported

CUT_OFF = 10.0


def expected_square(told, places, existence):
    """Expected square of GOSPA [m²] of told places against people who each exist with a probability, or not."""
    total = 0.0
    for there in product((False, True), repeat=len(places)):
        chance = np.prod(np.where(there, existence, 1.0 - np.array(existence)))
        total += chance * gospa(told, places[list(there)], CUT_OFF).distance ** 2
    return total


@pytest.mark.parametrize("seed", range(20))
def test_no_other_choice_of_tracks_has_a_smaller_expected_gospa(seed):
    rng = np.random.default_rng(seed)
    places = rng.permutation(np.arange(4))[:, None] * 50.0 + rng.normal(size=(4, 2))
    existence = rng.random(4).tolist()
    tracks = [Track(t, Gaussian(np.r_[places[t], 0, 0], np.eye(4)), r) for t, r in enumerate(existence)]
    choices = [places[list(choice)] for choice in product((False, True), repeat=4)]
    least = min(expected_square(told, places, existence) for told in choices)
    told = [track.belief.mean[:2] for track in tracks if track.reported]
    assert expected_square(np.reshape(told, (-1, 2)), places, existence) == pytest.approx(least, abs=1e-9)


@pytest.mark.parametrize("deviation", [0.5, 2.0, 4.0, 6.0, 9.0])
@pytest.mark.parametrize("existence", [0.3, 0.55, 0.7, 0.85, 0.95, 0.999])
def test_a_track_is_reported_where_that_lowers_the_gospa_expected_over_its_errors(deviation, existence):
    levels = (np.arange(2000) + 0.5) / 2000
    places = np.sqrt(-2.0 * np.log(levels))[:, None] * deviation * np.array([[0.6, 0.8]])  # quantiles of the distance
    told = np.zeros((1, 2))
    found = np.mean([gospa(told, place[None], CUT_OFF).distance ** 2 for place in places])
    costs = existence * found + (1.0 - existence) * gospa(told, told[:0], CUT_OFF).distance ** 2
    left_out = existence * gospa(told[:0], told, CUT_OFF).distance ** 2
    track = Track(1, Gaussian(np.zeros(4), np.diag([deviation**2, deviation**2, 1.0, 1.0])), existence)
    assert abs(costs - left_out) > 0.1 and track.reported == (costs < left_out)


def test_tracks_without_a_probability_are_reported_and_even_odds_are_not():
    belief = Gaussian(np.array([3.0, 4.0, 0.0, 0.0]), np.eye(4))
    anywhere = Gaussian(np.zeros(4), 1e4 * np.eye(4))
    assert Track(1, belief).reported and Track(1, anywhere).reported and not Track(2, belief, 0.5).reported


@pytest.mark.parametrize("oblong", [1.0, 4.0, 100.0])
def test_the_choice_for_an_oblong_belief_costs_at_most_a_tenth_of_the_cutoff_more(oblong):
    """The expected error is that of a round belief with the same trace; drawn errors show what this costs."""
    draws, worst = np.random.default_rng(0).standard_normal((50_000, 2)), 0.0
    for trace in np.linspace(2.0, 120.0, 30):
        variances = np.array([oblong, 1.0]) * trace / (oblong + 1.0)
        there = np.minimum((draws**2 * variances).sum(axis=1), CUT_OFF**2).mean()
        for r in np.linspace(0.05, 0.999, 60):
            told, left_out = r * there + (1 - r) * CUT_OFF**2 / 2, r * CUT_OFF**2 / 2
            chosen = told if Track(1, Gaussian(np.zeros(4), np.diag([*variances, 1.0, 1.0])), r).reported else left_out
            worst = max(worst, chosen - min(told, left_out))
    assert worst <= {1.0: 0.3, 4.0: 4.0, 100.0: 10.0}[oblong]


def test_the_array_form_agrees_with_single_tracks_and_reports_tracks_without_existence():
    rng = np.random.default_rng(1)
    covariances = np.array([np.diag([v, 2 * v, 1.0, 1.0]) for v in rng.uniform(0.1, 20.0, 200)])
    existence = np.r_[rng.random(198), 1.0, np.nan]
    flags = are_reported(existence, covariances)
    single = [Track(1, Gaussian(np.zeros(4), P), r).reported for r, P in zip(existence, covariances, strict=True)]
    assert flags.tolist() == single and flags[-2:].all() and 20 < flags.sum() < 120
