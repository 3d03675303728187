"""UAVs that are clear of everything need no engine, and fly to the same bits as with it."""

import numpy as np
import pytest

from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.world.world import World
from tracking.geometry.visibility import Forest, Tree

DYNAMICS = ("quadrotor", "kinematic")
LINE = tuple(Uav(start=(3.0 * i, 0.0), footprint=20.0 + i) for i in range(8))


def bits(world):
    return world.states.tobytes(), [(pose.position.tobytes(), pose.quaternion.tobytes()) for pose in world.poses()]


def poses_of_engine(world):
    """Those of the bodies in the engine, which is made if it was not."""
    found = [world.engine.getBasePositionAndOrientation(body.id) for body in world._bodies.uavs]
    return [(np.array(position).tobytes(), np.array(quaternion).tobytes()) for position, quaternion in found]


@pytest.mark.parametrize("windy", [False, True])
@pytest.mark.parametrize("dynamics", DYNAMICS)
def test_uavs_move_to_the_bits_of_the_engine_step_by_step(dynamics, windy):
    """Commands of all directions, along the axes too, and none, at which kinematic UAVs keep their headings."""
    rng, fleet = np.random.default_rng(0), Scenario(dynamics=dynamics, uavs=LINE)
    with World(fleet, Forest(()), 0) as stepped, World(fleet, Forest(()), 0) as free:
        for _ in range(100):
            commands = rng.uniform(-5, 5, (8, 2)) * rng.integers(0, 2, (8, 2))
            winds = rng.normal(0, 4, (5, 2)) if windy else None
            for k in range(5):
                stepped.step(commands, None if winds is None else winds[k])
            free.advance(commands, 5, winds)
            assert poses_of_engine(stepped) == bits(stepped)[1] and bits(stepped) == bits(free)
        assert stepped.velocities().tobytes() == free.velocities().tobytes()


def height(base):
    """Trees whose canopy, or whose trunk, is where the first of `LINE` flies to the east, and one beside its way."""
    return Tree(4.0, 0.1, 2.0, base, 30.0), Tree(4.2, 8.0, 2.0, base, 30.0)


@pytest.mark.parametrize("windy", [False, True])
@pytest.mark.parametrize("dynamics", DYNAMICS)
@pytest.mark.parametrize(
    ("uavs", "trees", "kinds"),
    [
        ([(0.0, 0.0), (6.0, 0.1), (0.0, 9.0)], (Tree(3.0, 1.0),), {"uav"}),
        ([(0.0, 0.0), (0.0, 7.9)], height(10.0), {"canopy"}),
        ([(0.0, 0.0), (0.0, 7.9)], height(25.0), {"trunk"}),
    ],
    ids=["one another", "into canopies", "into trunks"],
)
def test_uavs_collide_as_when_the_engine_makes_every_step(uavs, trees, kinds, dynamics, windy):
    """Bits and contacts of a flight into something and away from it."""
    rng, setting = np.random.default_rng(4), Scenario(dynamics=dynamics, uavs=tuple(Uav(start=at) for at in uavs))
    with World(setting, Forest(trees), 1) as stepped, World(setting, Forest(trees), 1) as free:
        touched = []
        for scan in range(40):
            if scan < 18:
                commands = np.array([[1.5, 0.0], [-1.0 if kinds == {"uav"} else 1.5, 0.0], [0.5, 0.0]])[: len(uavs)]
            else:
                commands = rng.uniform(-3, 3, (len(uavs), 2))
            winds = rng.normal(0, 2, (48, 2)) if windy else None
            for k in range(48):
                stepped.step(commands, None if winds is None else winds[k])
            free.advance(commands, 48, winds)
            touched.append(stepped.take_contacts())
            assert bits(stepped) == bits(free) and free.take_contacts() == touched[-1]
    assert {contact.kind for contacts in touched for contact in contacts} >= kinds
    assert sum(map(bool, touched)) < 40
