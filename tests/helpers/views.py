"""Scenes and cameras for tests of renderer and detector."""

import math

from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from tracking.geometry.camera import Camera
from tracking.geometry.visibility import Forest, Tree

CAMERA = Camera(math.radians(60), 128)
ALTITUDES = (17.3, 19.1, 21.7)
# One UAV in a corner, out of the cameras' way.
SCENARIO = Scenario(uavs=(Uav(start=(74.0, 49.0)),))


def random_forest(rng, count, radius):
    trees = []
    while len(trees) < count:
        x, y = rng.uniform(-40, 40, 2)
        if all(math.hypot(x - t.x, y - t.y) > 2 * radius for t in trees):
            trees.append(Tree(x, y, radius))
    return Forest(tuple(trees))
