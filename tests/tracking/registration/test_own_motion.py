"""Motion of a UAV from its believed positions, against the assumed process and known stories."""

import numpy as np
import pytest
from helpers.erring_fleets import DT

from tracking.metrics.nees import nees_interval
from tracking.navigation import Navigation
from tracking.registration.own_motion import OwnMotion


def follow(places, navigation):
    """Predictions to the second and later ones of places, and the odds of these."""
    motion, found = OwnMotion.start(places[0], navigation), []
    for place in places[1:]:
        motion = motion.predict(DT)
        odds = motion.judge(place)
        found.append((motion, odds))
        motion = motion.update(place, odds)
    return found


def test_velocities_of_accelerations_that_are_as_assumed_have_the_variance_that_is_told():
    """Also the predicted velocity is independent of the noise of the position that follows."""
    rng, navigation, kept = np.random.default_rng(700), Navigation(horizontal_noise=0.2), np.exp(-DT)
    nees, products = [], []
    for _ in range(200):
        velocity, acceleration, place = 5.0 * rng.standard_normal(2), 3.0 * rng.standard_normal(2), np.zeros(2)
        noises, places, velocities = 0.2 * rng.standard_normal((15, 2)), [], []
        for noise in noises:
            places.append(place + noise)
            velocities.append(velocity)
            acceleration = kept * acceleration + 3.0 * np.sqrt(1.0 - kept**2) * rng.standard_normal(2)
            place = place + DT * velocity + 0.5 * DT**2 * acceleration
            velocity = velocity + DT * acceleration
        motion = follow(places, navigation)[-1][0]
        nees.append(np.sum(np.square(motion.mean[1] - velocities[-1])) / motion.covariance[1, 1])
        products.append((motion.mean[1] - velocities[-1]) @ noises[-1])
    low, high = nees_interval(200, 2)
    assert low < np.mean(nees) < high, np.mean(nees)
    assert abs(np.mean(products)) < 3.0 * np.std(products) / np.sqrt(200)


@pytest.mark.parametrize("noise", [0.02, 0.2, 1.0])
def test_velocities_of_a_camera_that_hovers_are_noise(noise):
    rng, shares, ratios = np.random.default_rng(701), [], []
    for _ in range(30):
        *_, (motion, _) = follow(noise * rng.standard_normal((100, 2)), Navigation(horizontal_noise=noise))
        shares.append(motion.reliability)
        ratios.append(motion.squares / motion.squares_of_noise)
    assert np.mean(shares) < 0.25 and 0.8 < np.mean(ratios) < 1.25


def test_velocities_of_a_camera_in_flight_are_reliable():
    rng = np.random.default_rng(702)
    places = np.outer(4.0 * DT * np.arange(50), [0.6, 0.8]) + 0.2 * rng.standard_normal((50, 2))
    *_, (motion, _) = follow(places, Navigation(horizontal_noise=0.2))
    assert motion.reliability > 0.8


@pytest.mark.parametrize("metres", [2.0, 3.0, 5.0])
def test_a_jump_of_a_camera_that_hovers_is_told_from_a_turn_by_what_it_sees(metres):
    navigation = Navigation(horizontal_noise=0.05, horizontal_drift=1.0)
    places = 0.05 * np.random.default_rng(703).standard_normal((60, 2))
    *_, (motion, _) = follow(places, navigation)
    motion = motion.update(places[-1], motion.judge(places[-1])).predict(DT)
    place = motion.mean[0] + [metres, 0.0]
    assert motion.judge(place, 10.0).jump > 0.95 and motion.judge(place, -20.0).turn > 0.95
    assert motion.judge(place, 10.0).jump > motion.judge(place).jump
    jump = motion.find_jump(place)
    assert np.abs(jump.size - [metres, 0.0]).max() < 0.1 * metres and jump.variance < 0.1
    assert motion.judge(motion.mean[0]).jump == 0.0


def test_uavs_that_turn_at_once_are_believed_to_do_so_again():
    places = np.array([[4.0 * DT * abs(k % 20 - 10), 0.0] for k in range(81)])
    turns = [odds.turn for _, odds in follow(places + 0.01, Navigation(horizontal_noise=0.02))]
    assert turns[10] > 0.5 and min(turns[10 * k] for k in range(3, 8)) > 0.9
    assert follow(places, Navigation(horizontal_noise=0.02))[-1][0].turns == pytest.approx(7.0, abs=1.0)
