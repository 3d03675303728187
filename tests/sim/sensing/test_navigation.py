"""Navigation that errs: sizes and correlation of the errors, and where a believed pose puts people."""

import math

import msgspec
import numpy as np
import pytest

from sim.sensing.navigation import NavigationErrors
from tracking.geometry.camera import Pose
from tracking.geometry.quaternions import level_attitude
from tracking.navigation import NAVIGATION, Navigation

STILL = np.zeros(3)


def errors(seed=0, **figures):
    return NavigationErrors(Navigation(**figures), np.random.default_rng(seed))


def turn(pose):
    """Small rotation vector (3,) of a pose that was level."""
    return 2.0 * pose.quaternion[:3]


def test_errors_have_their_deviations():
    figures = {"horizontal_noise": 0.3, "vertical_noise": 0.1, "horizontal_drift": 0.4, "vertical_drift": 2.0}
    figures |= {"tilt_bias_deg": 0.3, "tilt_drift_deg": 0.4, "yaw_bias_deg": 1.2, "yaw_drift_deg": 0.5}
    drawn = [errors(seed, **figures).mislead(Pose.level(1, 2, 20)) for seed in range(3000)]
    moved = np.array([pose.position for pose in drawn]) - [1, 2, 20]
    turned = np.degrees([turn(pose) for pose in drawn])
    np.testing.assert_allclose(moved.std(axis=0), [0.5, 0.5, math.hypot(0.1, 2.0)], rtol=0.05)
    np.testing.assert_allclose(turned.std(axis=0), [0.5, 0.5, 1.3], rtol=0.05)
    assert np.abs(moved.mean(axis=0) / moved.std(axis=0)).max() < 4 / math.sqrt(3000)


def test_drifts_are_gauss_markov_and_biases_stay():
    def follow(seed):
        e = errors(seed, horizontal_drift=1.0, yaw_bias_deg=3.0)
        first = e.mislead(Pose.level(0, 0, 20))
        for _ in range(10):
            e.advance(15.0)
        return first, e.mislead(Pose.level(0, 0, 20))

    pairs = [follow(seed) for seed in range(2000)]
    before, after = (np.array([pose.position[:2] for pose in poses]) for poses in zip(*pairs, strict=True))
    assert after.std() == pytest.approx(1.0, rel=0.05)
    assert np.mean(before * after) == pytest.approx(math.exp(-150 / 300), abs=0.06)
    assert all(a.quaternion.tobytes() == b.quaternion.tobytes() for a, b in pairs)


@pytest.mark.parametrize("offset", [0.13, 0.5, -0.13, -0.37, -2.0])
def test_a_clock_offset_takes_the_pose_of_another_time(offset):
    """A body flies at constant velocity and turns at a constant rate; before the start it is at rest."""
    velocity, rate = np.array([5.0, -1.0, 0.5]), 0.1
    e = errors(clock_deviation=0.2)
    e.clock = offset
    for time in np.arange(0.0, 1.3, 0.2):
        body = Pose(time * velocity, np.array(level_attitude(rate * time)))
        stamped = e.mislead(e.stamp(time, body, velocity, np.array([0.0, 0.0, rate])))
        then = max(time + offset, 0.0)
        np.testing.assert_allclose(stamped.position, then * velocity, atol=1e-12)
        np.testing.assert_allclose(turn(stamped), [0, 0, 2 * math.sin(0.5 * rate * then)], atol=1e-6)


def test_a_clock_that_is_behind_does_not_show_a_turn_before_it_is_past():
    e = errors(clock_deviation=0.2)
    e.clock = -0.3
    speeds = [2.0, 2.0, 2.0, -4.0, -4.0]  # m/s, between scans a second apart
    places = np.concatenate([[0.0], np.cumsum(speeds)])
    seen = [
        e.stamp(float(k), Pose.level(x, 0, 20), np.array([s, 0.0, 0.0]), STILL).position[0]
        for k, (x, s) in enumerate(zip(places, [*speeds, 0.0], strict=True))
    ]
    np.testing.assert_allclose(seen, np.interp(np.arange(6) - 0.3, np.arange(6), places), atol=1e-12)


def test_presets_are_in_order_of_their_attitude_and_clock():
    rows = np.array([msgspec.structs.astuple(NAVIGATION[name])[5:10] for name in NAVIGATION], dtype=float)
    assert (np.diff(rows, axis=0) >= 0).all() and not rows[0].any()
