"""Wind pushes quadrotors, which hold velocity and altitude against it; gusts have the statistics asked for."""

import math

import numpy as np
import pytest
from helpers.flights import fly as fly_mission

from sim.mission.world_setup import Air
from sim.scenario.environment import Wind
from sim.scenario.scenario import Scenario
from sim.world.quadrotor import DRAG, GRAVITY, MASS

RATE = 240


def test_gusts_have_the_variance_and_correlation_time_asked_for_at_any_rate():
    for rate in (20, 100):
        series = Air(Wind(velocity=(3.0, -1.0), gust=1.5, gust_time=0.2), rate, np.random.default_rng(1)).steps(100_000)
        gusts = series - [3.0, -1.0]
        assert np.abs(gusts.mean(axis=0)).max() < 0.08 and gusts.std() == pytest.approx(1.5, rel=0.02)
        assert np.mean(gusts[:, 0] * gusts[:, 1]) == pytest.approx(0.0, abs=0.1)
        for lag in (0.1, 0.2, 0.4):
            k = round(lag * rate)
            correlation = np.mean(gusts[k:] * gusts[:-k]) / np.mean(gusts**2)
            assert correlation == pytest.approx(math.exp(-lag / 0.2), abs=0.03)


def test_gusts_start_in_their_steady_state_however_many_steps_are_asked():
    wind = Wind(gust=2.0, gust_time=100.0)
    first = np.array([Air(wind, RATE, np.random.default_rng(seed)).steps(1)[0] for seed in range(2000)])
    assert first.std() == pytest.approx(2.0, rel=0.05)
    one, other = (Air(Wind(gust=1.0), RATE, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(one.steps(96), np.vstack([other.steps(48), other.steps(1), other.steps(47)]))


def mission(*overrides, seed=0):
    return fly_mission("sensing.mode=ideal", *overrides, seed=seed, duration=3)[1]


def test_a_body_fixed_camera_leans_into_the_wind_and_a_gimbal_does_not():
    last = mission("wind.velocity=[3, 4]", "uavs.0.mount=body")[-1]
    tilt = math.atan(DRAG * 5.0 / (MASS * GRAVITY))
    assert math.degrees(tilt) > 8
    up = np.array([-0.6 * math.sin(tilt), -0.8 * math.sin(tilt), math.cos(tilt)])
    np.testing.assert_allclose(last.cameras[0].rotation[:, 2], up, atol=1e-3)
    np.testing.assert_array_equal(last.cameras[1].rotation, np.eye(3))
    for pose, uav in zip(last.poses, Scenario().uavs, strict=True):
        # The wind that is there from the first step on moves it before the controller has felt it.
        np.testing.assert_allclose(pose.position, [*uav.start, uav.altitude], atol=0.2)


def test_gusts_are_the_seeds_and_change_nothing_else():
    gusty = "wind.gust=2"
    first, again, other, calm = mission(gusty), mission(gusty), mission(gusty, seed=1), mission()
    for a, b, c in zip(first, again, calm, strict=True):
        for p, q in zip(a.poses, b.poses, strict=True):
            assert p.position.tobytes() + p.quaternion.tobytes() == q.position.tobytes() + q.quaternion.tobytes()
        np.testing.assert_array_equal(a.people, c.people)
    np.testing.assert_array_equal(first[0].scans[0].measurements, calm[0].scans[0].measurements)
    flown = [np.array([s.poses[0].position - s.poses[0].position.round() for s in run]) for run in (first, other)]
    assert not np.allclose(*flown, atol=1e-4)
    moved = np.array([s.poses[0].quaternion for s in first]) - np.array([s.poses[1].quaternion for s in first])
    assert np.abs(moved).max() < 1e-3  # the whole fleet meets the same gust
