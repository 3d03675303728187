"""A scene has the bodies that cameras show or showed lately, and its images are those of all bodies."""

import pickle

import numpy as np
import pybullet

from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.sensing.renderer import Renderer
from sim.world.shown_bodies import _KEPT
from sim.world.world import World
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree

UAV = Uav(start=(-70.0, -40.0))
ALONE = Scenario(uavs=(UAV,))
ROW = Forest(tuple(Tree(12.0 * k, 3.0) for k in range(60)))
PEOPLE = np.array([[12.0 * k + 6.0, -2.0] for k in range(60)])


def picture(world, renderer, x):
    """Bytes of the image from above a place on the row, and of its mask of people who walk on from view to view."""
    world.place_people(PEOPLE + 0.01 * x, np.full(len(PEOPLE), 0.02 * x))
    view = renderer.render(UAV.true_camera, Pose.level(x, 0.0, UAV.altitude))
    return view.image.tobytes(), view.people.tobytes()


def test_bodies_come_when_they_are_seen_and_go_when_they_are_not():
    ways = np.concatenate([np.linspace(0.0, 300.0, 120), np.linspace(300.0, 0.0, 120), np.zeros(2 * _KEPT)])
    with World(ALONE, ROW, len(PEOPLE)) as world:
        renderer, counts = Renderer(world), []
        for x in ways[::4]:
            found = picture(world, renderer, x)
            for _ in range(3):
                assert picture(world, renderer, x) == found
            counts.append(pybullet.getNumBodies(physicsClientId=world._shown_bodies.client))
            with World(ALONE, ROW, len(PEOPLE)) as fresh:
                assert picture(fresh, Renderer(fresh), x) == found
        assert max(counts) < 40 and counts[-1] < 10 and not world._made


def test_a_copy_of_a_world_shows_the_same():
    with World(ALONE, ROW, len(PEOPLE)) as world:
        first = picture(world, Renderer(world), 50.0)
        with pickle.loads(pickle.dumps(world)) as copy:
            assert picture(copy, Renderer(copy), 50.0) == first
        assert picture(world, Renderer(world), 50.0) == first
