"""Images of bodies are those of TinyRenderer, bit for bit."""

import math

import numpy as np
import pybullet
import pytest
from helpers.poses import tilted
from helpers.views import random_forest

from sim.scenario.environment import Area, Trees
from sim.scenario.scenario import Scenario
from sim.sensing.rasteriser import Rasteriser
from sim.sensing.renderer import _LIGHT, capture
from sim.world.forest import grow
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose

LEAFY = Trees(per_hectare=200, height=(4.0, 9.0), overlap=True, leaf_area_density=0.6)


@pytest.mark.parametrize("leafy", [False, True])
def test_images_and_bodies_are_those_of_tiny_renderer(leafy):
    """From near and far, level and oblique, also where the near plane cuts trees and UAVs."""
    rng = np.random.default_rng(leafy)
    forest = grow(LEAFY, Area(40.0, 40.0), rng) if leafy else random_forest(rng, 40, 5.0)
    client = pybullet.connect(pybullet.DIRECT)
    shown = set()
    with World(Scenario(), forest, 20, 3, client=client) as world:
        world.place_people(rng.uniform(-20, 20, (20, 2)), rng.uniform(-math.pi, math.pi, 20))
        attitudes = rng.normal(size=(3, 4))
        attitudes /= np.linalg.norm(attitudes, axis=1)[:, None]
        world.place_uavs([Pose(rng.uniform([-9, -9, 5], [9, 9, 23]), q) for q in attitudes])
        rasteriser, everything = Rasteriser(world), np.ones(len(world.models), dtype=bool)
        light = {**_LIGHT, "lightDirection": world.style.light, "lightAmbientCoeff": world.style.ambient}
        numbers = np.full(2 * len(world.bodies) + 2, -1)
        numbers[[body.id for body in world.bodies]] = range(len(world.bodies))
        for k in range(60):
            camera = Camera(math.radians(rng.uniform(20, 110)), int(rng.integers(20, 150)))
            pose = tilted(rng, [*rng.uniform(-20, 20, 2), rng.uniform(2, 25)], (0.0, 0.3, 1.5)[k % 3])
            expected, found = capture(client, camera, pose, light=light), rasteriser.draw(camera, pose, everything)
            np.testing.assert_array_equal(found.image, expected.image)
            np.testing.assert_array_equal(found.bodies, numbers[expected.bodies])
            shown |= {world.models[n].kind for n in np.unique(found.bodies).tolist() if n >= 0}
    assert shown == {"canopy", "trunk", "person", "uav"}
