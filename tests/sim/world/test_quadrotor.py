import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from planning.prediction.response import mean_velocities, response
from sim.mission.knowledge import BodyState, vehicle_of
from sim.scenario.scenario import Rates, Scenario
from sim.scenario.uavs import Uav
from sim.world.quadrotor import (
    GRAVITY,
    MASS,
    MAX_ROTOR_THRUST,
    rotor_thrusts,
)
from sim.world.world import World
from tracking.geometry.camera import Pose
from tracking.geometry.quaternions import rotate
from tracking.geometry.visibility import Forest

LEVEL = [0.0, 0.0, 0.0, 1.0]
UAV = Uav(start=(0.0, 0.0))
RATE = 240
CALM = np.zeros(3)


def state(position=(0, 0, 20), quaternion=LEVEL, velocity=(0, 0, 0), spin=(0, 0, 0)):
    return np.array([*position, *quaternion, *velocity, *spin], dtype=float)


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (3.0, -4.0)])
def test_at_the_commanded_velocity_rotors_take_the_weight_in_equal_parts(velocity):
    thrusts = rotor_thrusts(state(velocity=(*velocity, 0)), np.array([*velocity, 20.0]), CALM)
    assert_allclose(thrusts, [*[MASS * GRAVITY / 4] * 4, 0.0], rtol=1e-14, atol=1e-14)


def test_thrusts_stay_within_limits():
    rng = np.random.default_rng(1)
    for _ in range(2000):
        wild = state(rng.normal(0, 50, 3), Rotation.random(random_state=rng).as_quat(), *rng.normal(0, 8, (2, 3)))
        thrusts = rotor_thrusts(wild, rng.uniform(-20, 40, 3), rng.normal(0, 5, 3))
        assert np.all((thrusts[:4] >= 0) & (thrusts[:4] <= MAX_ROTOR_THRUST)) and np.isfinite(thrusts[4])


def fly(commands, seconds, quaternion=LEVEL, wind=None, rate=RATE):
    """Velocities (K, 3), heights above the commanded one (K,) and tilts (K,) rad in the engine."""
    with World(Scenario(uavs=(UAV,), rates=Rates(physics=rate)), Forest(()), 0) as world:
        world.states[0, 3:7] = quaternion
        rows = []
        for command in commands:
            for _ in range(round(seconds * rate)):
                world.step(np.array([command], dtype=float), None if wind is None else np.array(wind, dtype=float))
                pose = world.poses()[0]
                rows.append([*world.velocities()[0], pose.position[2] - UAV.altitude, pose.rotation[2, 2]])
    rows = np.array(rows)
    return rows[:, :3], rows[:, 3], np.arccos(np.clip(rows[:, 4], -1, 1))


def test_a_quadrotor_turns_as_in_the_engine_but_by_our_sine_and_cosine():
    rng, off = np.random.default_rng(6), []
    with World(Scenario(uavs=(UAV,)), Forest(()), 0) as world:
        (uav,), engine = world.bodies, world.engine
        for _ in range(200):
            before = world.poses()[0]
            world.step(rng.uniform(-5, 5, (1, 2)))
            spin = world.states[0, 10:13]
            np.testing.assert_array_equal(world.states[0, 3:7], rotate(before.quaternion, spin, 1 / RATE))
            # The engine by itself, from the same place at the same spin.
            engine.resetBasePositionAndOrientation(uav.id, before.position.tolist(), before.quaternion.tolist())
            engine.resetBaseVelocity(uav.id, (0.0, 0.0, 0.0), spin.tolist())
            engine.stepSimulation()
            _, by_itself = engine.getBasePositionAndOrientation(uav.id)
            _, spin_then = engine.getBaseVelocity(uav.id)
            off.append(np.abs(by_itself - rotate(before.quaternion, np.array(spin_then), 1 / RATE)).max())
    assert 0.0 < max(off) < 2e-15


def test_the_quadrotor_reaches_its_top_speed_and_stops_without_overshoot():
    velocity, height, tilt = fly([(5, 0), (0, 0)], 3.0)
    going, stopping = np.split(velocity[:, 0], 2)
    assert np.argmax(going > 0.95 * 5) / RATE < 1.2 and np.argmax(stopping < 0.05 * 5) / RATE < 1.2
    assert going.max() < 5.01 and stopping.min() > -0.01 and going[-1] == pytest.approx(5, abs=0.01)
    assert stopping[-1] == pytest.approx(0, abs=0.01) and np.abs(velocity[:, 1]).max() < 1e-6
    assert np.abs(height).max() < 0.3 and tilt.max() < math.radians(35)


def test_the_quadrotor_keeps_altitude_and_tilt_under_reversals_and_random_commands():
    velocity, height, tilt = fly([(5, 0), (-5, 0), (5, 0), (0, 5), (0, -5)], 2.5)
    ends = velocity[round(2.5 * RATE) - 1 :: round(2.5 * RATE), :2]
    assert_allclose(ends, [(5, 0), (-5, 0), (5, 0), (0, 5), (0, -5)], atol=0.05)
    assert np.abs(height).max() < 0.3 and tilt.max() < math.radians(35)
    rng = np.random.default_rng(4)
    _, height, tilt = fly(rng.uniform(-3.5, 3.5, (40, 2)), 1.0)
    assert np.abs(height).max() < 0.3 and tilt.max() < math.radians(35)


def test_attitudes_are_stable_at_the_least_rate_of_physics_and_lower_ones_are_refused():
    commands = np.random.default_rng(5).uniform(-3.5, 3.5, (20, 2))
    _, height, tilt = fly(commands, 1.0, rate=25)
    assert np.abs(height).max() < 0.3 and tilt.max() < math.radians(35)
    with pytest.raises(ValueError, match=r"rates\.physics: at 20 Hz"):
        fly(commands, 1.0, rate=20)


@pytest.mark.parametrize(("step", "metres", "most_left"), [(1.0, 1.4, 0.21), (0.2, 0.43, 0.15)])
def test_planners_foresee_where_a_quadrotor_is_a_step_after_each_of_random_commands(step, metres, most_left):
    """`metres` is the error of [Li22] eq. (5), by which velocities follow commands at once; a share of it is left."""
    commands = np.random.default_rng(7).uniform(-3.5, 3.5, (60, 2))
    velocities = fly(commands, step)[0][:, :2].reshape(60, -1, 2)
    foreseen = []
    for now, command in zip(velocities[:-1, -1], commands[1:], strict=True):
        vehicle = vehicle_of(Scenario(uavs=(UAV,)), 0, BodyState(Pose.level(0.0, 0.0, UAV.altitude), now))
        foreseen.append(mean_velocities(response([vehicle], step), command[None, None, None])[0, 0, 0])
    means = velocities[1:].mean(axis=1)
    off, at_once = (np.sqrt(np.mean((means - expected) ** 2)) for expected in (np.array(foreseen), commands[1:]))
    assert at_once * step == pytest.approx(metres, rel=0.05) and off < most_left * at_once


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0.6, 0.8, 0), (0.5, 0.5, 0.7)])
def test_the_quadrotor_recovers_from_a_tilt_of_thirty_degrees(axis):
    tilted = Rotation.from_rotvec(math.radians(30) * np.array(axis) / np.linalg.norm(axis)).as_quat()
    velocity, height, tilt = fly([(0, 0)], 2.0, tilted)
    assert tilt[-1] < math.radians(0.1) and np.abs(velocity[-1]).max() < 0.02 and np.abs(height).max() < 0.3


@pytest.mark.parametrize("wind", [(5, 0), (-3, 4), (0, 0)])
def test_steady_wind_leaves_no_error_of_velocity_or_altitude(wind):
    commands = [(0, 0), (5, 0), (0, -5), (0, 0)]
    velocity, height, _ = fly(commands, 4.0, wind=wind)
    for command, flown in zip(commands, np.split(velocity, 4), strict=True):
        error = flown[2 * RATE :] - [*command, 0.0]
        assert np.linalg.norm(error.mean(axis=0)) < 0.02 and np.abs(error[-1]).max() < 0.001
    assert np.abs(height).max() < 0.1


def test_the_strongest_wind_can_be_flown_against_and_winds_nothing_up():
    velocity, height, tilt = fly([(0, 0), (-5, 0)], 4.0, wind=(12, 0))
    assert velocity[4 * RATE - 1 :: 4 * RATE, 0] == pytest.approx([0.0, -5.0], abs=0.05)
    assert np.abs(height).max() < 0.1 and tilt.max() < math.radians(35)
    velocity, height, _ = fly([(-30, 0), (0, 0)], 4.0, wind=(12, 0))
    reaching, stopping = np.split(velocity[:, 0], 2)
    assert reaching[-1] > -20  # saturated for four seconds
    assert stopping.max() < 0.05  # and then stops without overshoot
    assert stopping[-1] == pytest.approx(0.0, abs=0.05) and np.abs(height).max() < 0.3
