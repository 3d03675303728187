"""Kinematic UAVs that nothing renders need no engine, and fly to the same bits as with it."""

import math

import numpy as np
import pytest
from helpers.flights import fly, recording_of

from planning.planner import Plan
from sim.recording.archive import digest
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.world.contacts import nearest_approach
from sim.world.world import World
from tracking.geometry.visibility import Forest

IDEAL = ("sensing.mode=ideal", "dynamics=kinematic")
FLEET = Scenario(dynamics="kinematic", uavs=tuple(Uav(start=(3.0 * i, 0.0), footprint=20.0 + i) for i in range(8)))


def bits(world):
    return [(pose.position.tobytes(), pose.quaternion.tobytes()) for pose in world.poses()]


def bits_of_engine(world):
    """Those of the bodies in the engine, which is made if it was not."""
    engine = world.engine
    found = [engine.getBasePositionAndOrientation(body.id) for body in world._bodies.uavs]
    return [(np.array(position).tobytes(), np.array(quaternion).tobytes()) for position, quaternion in found]


def test_uavs_glide_to_the_bits_of_the_engine_step_by_step():
    """Commands of all directions, along the axes too, and none, at which headings are kept."""
    rng = np.random.default_rng(0)
    with World(FLEET, Forest(()), 0) as stepped, World(FLEET, Forest(()), 0) as glided:
        for _ in range(200):
            commands = rng.uniform(-5, 5, (8, 2)) * rng.integers(0, 2, (8, 2))
            for _ in range(3):
                stepped.step(commands)
            glided._glide(commands, 3)
            assert bits_of_engine(stepped) == bits(stepped) == bits(glided)
        assert stepped.velocities().tobytes() == glided.velocities().tobytes()


def test_no_pair_comes_nearer_than_the_bound_says():
    rng = np.random.default_rng(1)
    for _ in range(200):
        positions, commands = rng.uniform(-5, 5, (4, 3)), rng.uniform(-5, 5, (4, 2))
        bound, seconds = nearest_approach(positions, commands, 0.7), np.linspace(0, 0.7, 50)
        ways = positions[:, None] + np.pad(commands, ((0, 0), (0, 1)))[:, None] * seconds[:, None]
        gaps = np.linalg.norm(ways[:, None] - ways[None], axis=-1)
        assert bound <= gaps[~np.eye(4, dtype=bool)].min() + 1e-12
    assert nearest_approach(np.zeros((1, 3)), np.zeros((1, 2)), 1.0) == math.inf


class Wanderer:
    """Every UAV flies somewhere, hovers, or goes to the middle."""

    def plan(self, team, rng):
        ways = [rng.uniform(-3, 3, 2) for _ in team]
        chances = rng.choice([0, 1, 2, 2, 2], len(team))
        middle = [np.clip(-s.own.position[:2], -2, 2) for s in team]
        return [Plan(np.array([[w, 0 * w, m][k]])) for w, m, k in zip(ways, middle, chances, strict=True)]


MEETING = "uavs=[{start=[-2, 0], footprint=20}, {start=[2, 0], footprint=20}, {start=[0, 9], footprint=30}]"
LOW = "uavs=[{start=[-2, 0], footprint=8}]"  # at 6.9 m, 0.9 m above the canopies


@pytest.mark.parametrize(
    ("overrides", "met", "engine"),
    [
        (IDEAL, False, False),
        ((*IDEAL, *(f"uavs.{i}.mount=body" for i in range(3)), "uavs.0.tilt_deg=20"), False, False),
        ((*IDEAL, MEETING), True, True),
        ((*IDEAL, LOW), False, True),
        (("dynamics=kinematic", MEETING), True, True),
    ],
    ids=["apart", "body-fixed", "meeting", "low", "rendered"],
)
def test_missions_without_an_engine_have_the_bytes_of_those_with_one(overrides, met, engine, monkeypatch):
    duration = 6 if overrides == (*IDEAL, MEETING) else 4  # they part again after 5 s
    mission, snapshots = fly(*overrides, planner=Wanderer(), duration=duration, seed=4)
    assert any(snapshot.contacts for snapshot in snapshots) == met and mission._world._made == engine
    found = digest(recording_of(mission, snapshots))
    monkeypatch.setattr(World, "_apart", lambda *_: False)
    mission, snapshots = fly(*overrides, planner=Wanderer(), duration=duration, seed=4)
    assert mission._world._made and digest(recording_of(mission, snapshots)) == found
