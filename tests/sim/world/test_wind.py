"""Wind pushes quadrotors, which hold velocity and altitude against it; gusts have the statistics asked for."""

import math

import numpy as np
import pytest

from sim.mission.mission import Mission, Trial
from sim.scenario.environment import Wind
from sim.scenario.fleet import Uav
from sim.scenario.loading import load
from sim.scenario.scenario import Scenario
from sim.world.quadrotor import DRAG, GRAVITY, MASS
from sim.world.wind import Air
from sim.world.world import World
from tracking.geometry.visibility import Forest

UAV = Uav(start=(0.0, 0.0))
RATE = 240


def fly(commands, seconds, wind):
    """Velocities (C, K, 3), heights above the commanded one (C, K) and the body's up (C, K, 3) under each command."""
    with World(Scenario(uavs=(UAV,)), Forest(()), 0) as world:
        rows = []
        for command in commands:
            for _ in range(round(seconds * RATE)):
                world.step(np.array([command], dtype=float), np.array(wind, dtype=float))
                pose = world.poses()[0]
                rows.append([*world.velocities()[0], pose.position[2] - UAV.altitude, *pose.rotation[:, 2]])
    table = np.array(rows).reshape(len(commands), -1, 7)
    return table[..., :3], table[..., 3], table[..., 4:]


@pytest.mark.parametrize("wind", [(5, 0), (-3, 4), (0, 0)])
def test_steady_wind_leaves_no_error_of_velocity_or_altitude(wind):
    commands = [(0, 0), (5, 0), (0, -5), (0, 0)]
    velocity, height, _ = fly(commands, 4.0, wind)
    for command, flown in zip(commands, velocity, strict=True):
        error = flown[2 * RATE :] - [*command, 0.0]
        assert np.linalg.norm(error.mean(axis=0)) < 0.02
        assert np.abs(error[-1]).max() < 0.001
    assert np.abs(height).max() < 0.1


def test_the_strongest_wind_allowed_can_be_flown_against():
    velocity, height, up = fly([(0, 0), (-5, 0)], 4.0, (12, 0))
    assert velocity[:, -1, 0] == pytest.approx([0.0, -5.0], abs=0.05)
    assert np.abs(height).max() < 0.1
    assert np.arccos(up[..., 2].min()) < math.radians(35)


def test_commands_out_of_reach_do_not_wind_the_controller_up():
    velocity, height, _ = fly([(-30, 0), (0, 0)], 4.0, (12, 0))
    assert velocity[0, -1, 0] > -20  # saturated for four seconds
    assert velocity[1, :, 0].max() < 0.05  # and then stops without overshoot
    assert velocity[1, -1, 0] == pytest.approx(0.0, abs=0.05)
    assert np.abs(height).max() < 0.3


def test_gusts_have_the_variance_and_correlation_time_asked_for_at_any_rate():
    for rate in (20, 100):
        series = Air(Wind(velocity=(3.0, -1.0), gust=1.5, gust_time=0.2), rate, np.random.default_rng(1)).steps(100_000)
        gusts = series - [3.0, -1.0]
        assert np.abs(gusts.mean(axis=0)).max() < 0.08
        assert gusts.std() == pytest.approx(1.5, rel=0.02)
        assert np.mean(gusts[:, 0] * gusts[:, 1]) == pytest.approx(0.0, abs=0.1)
        for lag in (0.1, 0.2, 0.4):
            k = round(lag * rate)
            correlation = np.mean(gusts[k:] * gusts[:-k]) / np.mean(gusts**2)
            assert correlation == pytest.approx(math.exp(-lag / 0.2), abs=0.03)


def test_gusts_start_in_their_steady_state():
    wind = Wind(gust=2.0, gust_time=100.0)
    first = np.array([Air(wind, RATE, np.random.default_rng(seed)).steps(1)[0] for seed in range(2000)])
    assert first.std() == pytest.approx(2.0, rel=0.05)


def test_gusts_do_not_depend_on_how_many_steps_are_asked_for_at_once():
    one, other = (Air(Wind(gust=1.0), RATE, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(one.steps(96), np.vstack([other.steps(48), other.steps(1), other.steps(47)]))


def mission(*overrides, seed=0):
    setting = load("forest", ["duration=3", "sensing.mode=ideal", *overrides])
    return list(Mission.of(Trial(setting, "hover", seed)).fly())


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


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["wind.velocity=[12, 5]"], ["wind", "velocity [12.0, 5.0]", "13 m/s", "at most 12 m/s"]),
        (["wind.gust=-1"], ["wind.gust", "-1", ">= 0"]),
        (["wind.gust_time=0"], ["wind.gust_time", ">= 0.01"]),
        (["wind.velocty=[1, 0]"], ["wind.velocty", "did you mean velocity"]),
        (["wind.gust=1", "dynamics=kinematic"], ["wind", "kinematic", "quadrotor"]),
    ],
)
def test_a_wrong_wind_is_named_in_one_line(overrides, words):
    with pytest.raises(ValueError) as caught:
        load("forest", overrides)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message
