"""Reported tracks: the choice with the least expected GOSPA, by enumeration of all choices and of who exists."""

from itertools import product

import numpy as np
import pytest

from tracking.filter.kalman import Gaussian
from tracking.metrics.ospa import gospa
from tracking.track import Track

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


def test_tracks_without_a_probability_are_reported_and_even_odds_are_not():
    belief = Gaussian(np.array([3.0, 4.0, 0.0, 0.0]), np.eye(4))
    assert Track(1, belief).reported and not Track(2, belief, 0.5).reported
