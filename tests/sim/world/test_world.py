import copy
import math
from pathlib import Path

import numpy as np
import pybullet
import pytest
from helpers.clients import open_clients

from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.world.quadrotor import GRAVITY, INERTIA, MASS, ROTORS, rotor_thrusts
from sim.world.world import World
from tracking.geometry.visibility import Forest, Tree

DT = 1 / 240
ONE = Scenario(uavs=(Uav(start=(1.0, 2.0)),))
NO_TREES = Forest(())


def test_uavs_start_level_at_their_places_in_a_world_that_closes():
    scenario = Scenario()
    with World(scenario, NO_TREES, 0) as world:
        for uav, pose in zip(scenario.uavs, world.poses(), strict=True):
            assert pose.position == pytest.approx([*uav.start, uav.altitude])
            assert pose.quaternion == pytest.approx([0, 0, 0, 1])
        assert np.array_equal(world.velocities(), np.zeros((3, 3)))
    with World(ONE, NO_TREES, 0) as world:
        there, client = open_clients(), world.client
        assert pybullet.isConnected(physicsClientId=client)
        assert len(open_clients()) == len(there) + 1
    assert open_clients() == there
    assert not pybullet.isConnected(physicsClientId=world.client)
    world.close()


def test_a_world_that_is_closed_again_leaves_the_next_one_open():
    """PyBullet gives the number of a closed client to the next one."""
    first = World(ONE, NO_TREES, 0)
    assert first.client in open_clients()
    first.close()
    with World(ONE, NO_TREES, 0) as second:
        assert second.client == first.client
        there = open_clients()
        for closed in (first, copy.copy(first)):
            closed.close()
            assert open_clients() == there
    assert second.client not in open_clients()


def test_a_world_whose_bodies_cannot_be_made_leaves_no_client(monkeypatch, tmp_path):
    monkeypatch.setattr("sim.world.bodies.ASSETS", tmp_path)
    before = open_clients()
    for client in (None, pybullet.connect(pybullet.DIRECT)):
        with pytest.raises(pybullet.error):
            _ = World(ONE, NO_TREES, 0, client=client).bodies
    assert open_clients() == before


def test_rotors_move_the_body_as_newton_and_euler_say():
    rng = np.random.default_rng(0)
    with World(ONE, NO_TREES, 0) as world:
        for _ in range(50):
            quaternion = rng.normal(0, [0.2, 0.2, 0.4, 1.0])
            quaternion /= np.linalg.norm(quaternion)
            world.states[0] = [*rng.uniform(-30, 30, 2), 17.0, *quaternion, *rng.normal(0, 1, 6)]
            before, command = world.states[0].copy(), rng.uniform(-3, 3, 2)
            rotation = world.poses()[0].rotation
            *thrusts, yaw = rotor_thrusts(before, np.array([*command, ONE.uavs[0].altitude]), np.zeros(3))
            world.step(command[None])

            force = rotation @ [0, 0, sum(thrusts)] / MASS - [0, 0, GRAVITY]
            torque = np.cross(ROTORS, np.outer(thrusts, [0, 0, 1])).sum(axis=0) + np.array([0, 0, yaw])
            spin = rotation.T @ before[10:13]
            turning = rotation @ ((torque - np.cross(spin, INERTIA * spin)) / INERTIA)
            assert world.states[0, 7:10] == pytest.approx(before[7:10] + DT * force, abs=1e-9)
            assert world.states[0, :3] == pytest.approx(before[:3] + DT * world.states[0, 7:10], abs=1e-9)
            # The engine integrates the gyroscopic torque implicitly: a difference of second order in the step.
            assert world.states[0, 10:13] == pytest.approx(before[10:13] + DT * turning, abs=2e-3)


def test_kinematic_motion_is_the_papers_equation():
    scenario = Scenario(dynamics="kinematic")
    start = np.array([uav.start for uav in scenario.uavs])
    commands = np.array([[3.0, 4.0], [-1.0, 0.5], [0.0, -2.0]])
    with World(scenario, NO_TREES, 0) as world:
        for _ in range(240):
            world.step(commands)
        assert np.array_equal(world.velocities()[:, :2], commands)
        world.step(np.zeros((3, 2)))
        assert np.array_equal(world.velocities(), np.zeros((3, 3)))
        for i, pose in enumerate(world.poses()):
            assert pose.position == pytest.approx([*(start[i] + commands[i]), scenario.uavs[i].altitude], abs=1e-9)
            forward = [*(commands[i] / np.linalg.norm(commands[i])), 0.0]
            assert pose.rotation[:, 0] == pytest.approx(forward, abs=1e-9)
            assert pose.rotation[:, 2] == pytest.approx([0.0, 0.0, 1.0])


def test_the_same_commands_give_the_same_bits_in_interleaved_worlds():
    rng = np.random.default_rng(3)
    forest = Forest((Tree(0.0, 0.0), Tree(20.0, 5.0)))
    with World(Scenario(), forest, 2) as one, World(Scenario(), forest, 2) as other:
        for _ in range(200):
            commands = rng.uniform(-5, 5, (3, 2))
            one.step(commands)
            other.step(commands)
        for a, b in zip(one.poses(), other.poses(), strict=True):
            assert a.position.tobytes() == b.position.tobytes()
            assert a.quaternion.tobytes() == b.quaternion.tobytes()
        assert one.velocities().tobytes() == other.velocities().tobytes()


def test_trees_are_solid_exactly_where_the_forest_says():
    rng = np.random.default_rng(0)
    trees = (Tree(-8.0, 0.0), Tree(6.0, 3.0, 2.0, 2.5, 7.0, 0.5), Tree(3.0, -9.0, 4.0, 3.0, 5.0))
    forest = Forest(trees)
    origins = np.column_stack([rng.uniform(-15, 15, (2000, 2)), np.full(2000, 15.0)])
    ends = np.column_stack([rng.uniform(-15, 15, (2000, 2)), rng.uniform(0.1, 2.0, 2000)])
    grown, shrunk = (
        Forest(
            tuple(
                Tree(t.x, t.y, t.canopy_radius + e, t.canopy_base - e, t.canopy_top + e, t.trunk_radius + e)
                for t in trees
            )
        )
        for e in (0.05, -0.05)
    )
    ways = list(zip(origins, ends, strict=True))
    free = np.array([forest.visible(o, p)[0, 0] for o, p in ways])
    sure = np.array([grown.visible(o, p)[0, 0] == shrunk.visible(o, p)[0, 0] for o, p in ways])
    with World(ONE, forest, 0) as world:
        hits = pybullet.rayTestBatch(origins.tolist(), ends.tolist(), physicsClientId=world.client)
    open_ = np.array([hit[0] == -1 for hit in hits])
    assert np.array_equal(open_[sure], free[sure]) and 0.2 < free.mean() < 0.8 and sure.mean() > 0.95


def test_people_stand_where_placed_within_centres_and_radii_of_bodies():
    positions = np.array([[3.0, -4.0], [np.nan, np.nan], [0.0, 1.0]])
    with World(ONE, NO_TREES, 3) as world:
        assert np.isnan(world.centres[:3]).all()
        world.place_people(positions, np.array([0.5, np.nan, -2.0]))
        assert world.centres[:3, :2] == pytest.approx(positions, nan_ok=True)
        ids = [body.id for body in world.bodies if body.kind == "person"]
        places = [pybullet.getBasePositionAndOrientation(k, physicsClientId=world.client) for k in ids]
        assert places[0][0] == (3.0, -4.0, 0.0)
        assert places[0][1] == pytest.approx((0, 0, math.sin(0.25), math.cos(0.25)))
        assert places[1][0][2] < -100.0
        world.place_people(positions[::-1], np.zeros(3))
        assert world.centres[2, :2] == pytest.approx([3.0, -4.0])
    trees = (Tree(-8.0, 0.0), Tree(6.0, 3.0, 2.0, 2.5, 7.0, 0.5))
    with World(Scenario(), Forest(trees), 2) as world:
        world.place_people(np.array([[1.0, 2.0], [-3.0, 9.0]]), np.array([0.3, 2.0]))
        assert [b.kind for b in world.bodies] == ["canopy"] * 2 + ["trunk"] * 2 + ["person"] * 2 + ["uav"] * 3
        for body, centre in zip(world.bodies, world.centres, strict=True):
            shape = pybullet.getVisualShapeData(body.id, physicsClientId=world.client)[0]
            lines = Path(shape[4].decode()).read_text().splitlines()
            points = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
            origin, turn = pybullet.getBasePositionAndOrientation(body.id, physicsClientId=world.client)
            rotation = np.array(pybullet.getMatrixFromQuaternion(turn)).reshape(3, 3)
            points = points * shape[3] @ rotation.T + origin
            assert np.linalg.norm(points - centre, axis=1).max() <= body.radius
