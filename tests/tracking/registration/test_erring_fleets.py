"""Fleets whose clocks and positions err, over fresh seeds: what they learn, and whom they hold.

The constants of `tracking.registration.own_motion` were chosen with seeds 0 to 31.
"""

from functools import cache

import numpy as np
import pytest
from helpers.erring_fleets import find_nees, hover, make_fleet, reverse_at_once, run_fleet, turn_back
from scipy.stats import norm

from tracking.navigation import NAVIGATION, Navigation

DRIFT = Navigation(horizontal_drift=1.0, horizontal_noise=0.05)
SEEDS = range(400, 408)


def judge_clocks(seeds, figures, **case):
    """NEES of the clocks of each mission's UAVs after its last scan, and mean deviation that they tell [s].

    Offsets are the quantiles of their law in the middle of equal shares, so that the prior has a NEES of 1.
    """
    nees, deviations = [], []
    offsets = figures.clock_deviation * norm.ppf((np.arange(len(seeds)) + 0.5) / len(seeds))
    for seed, offset in zip(seeds, offsets, strict=True):
        fleet = run_fleet(make_fleet(seed, figures, clocks=[offset, -offset], **case))
        for clock, tracker in zip(fleet.clocks, fleet.trackers, strict=True):
            registration = tracker._registration
            nees.append((clock - registration.errors[6]) ** 2 / registration.covariance[6, 6])
            deviations.append(np.sqrt(registration.covariance[6, 6]))
    return nees, np.mean(deviations)


def judge_positions(seeds, figures, *, uavs, since, **case):
    """NEES per dimension of the first UAV's position from scan `since` on, and the share of people held within 1.5 m.

    A lone UAV's position is compared with the truth; that of others with the position of the second, because errors
    that a fleet shares do not show.
    """
    nees, held = [], []

    def see(k, fleet):
        if k < since:
            return
        left = [e - t._registration.errors[:2] for e, t in zip(fleet.offsets[k], fleet.trackers, strict=True)]
        spread = [t._registration.covariance[:2, :2] for t in fleet.trackers]
        error, covariance = (left[0], spread[0]) if uavs == 1 else (left[0] - left[1], spread[0] + spread[1])
        nees.append(find_nees(error, covariance))
        for tracker in fleet.trackers:
            places = {track.id: track.belief.mean[:2] for track in tracker.tracks}
            people = enumerate(fleet.people[k, :, :2])
            held.extend(m in places and np.hypot(*(places[m] - place)) < 1.5 for m, place in people)

    for seed in seeds:
        run_fleet(make_fleet(seed, figures, uavs=uavs, **case), see)
    return np.mean(nees), np.mean(held)


@cache
def judge_drift(uavs):
    """The same of positions that only drift."""
    return judge_positions(SEEDS, DRIFT, uavs=uavs, since=26)


@pytest.mark.parametrize("uavs", [1, 2])
@pytest.mark.parametrize("noise", [0.05, 0.2])
def test_a_camera_that_hovers_does_not_learn_its_clock(noise, uavs):
    figures = Navigation(horizontal_noise=noise, clock_deviation=0.15)
    nees, deviation = judge_clocks(SEEDS, figures, uavs=uavs, scans=76, path=hover)
    assert np.mean(nees) < 2.0 and max(nees) < 9.0 and deviation > 0.12, (np.mean(nees), max(nees), deviation)


@pytest.mark.parametrize("path", [turn_back, reverse_at_once])
def test_a_camera_that_turns_back_learns_its_clock(path):
    nees, deviation = judge_clocks(range(420, 436), Navigation(horizontal_noise=0.05, clock_deviation=0.1), path=path)
    assert np.mean(nees) < 2.0 and deviation < 0.075, (np.mean(nees), np.median(nees), max(nees), deviation)


@pytest.mark.parametrize("uavs", [1, 2])
@pytest.mark.parametrize("metres", [1.0, 2.0, 3.0, 5.0])
def test_after_a_jump_of_a_position_people_are_held_and_errors_known_as_without(metres, uavs):
    nees, held = judge_positions(SEEDS, DRIFT, uavs=uavs, since=26, jumps=((25, 0, metres),))
    without = judge_drift(uavs)
    assert nees < without[0] + 0.5 and held > without[1] - 0.05, (nees, held, without)


@pytest.mark.parametrize("name", ["rtk", "gnss", "consumer"])
def test_a_uav_that_turns_survives_a_jump_and_the_way_back(name):
    case = {"path": turn_back, "jumps": ((20, 0, 3.0), (38, 0, -3.0))}
    nees, held = judge_positions(SEEDS, NAVIGATION[name], uavs=2, since=21, **case)
    assert nees < 2.0 and held > 0.7, (nees, held)
