"""Occlusion by trees in images against the line of sight."""

import math

import numpy as np
from helpers.poses import tilted
from helpers.views import ALTITUDES, SCENARIO, random_forest

from sim.sensing.renderer import capture
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest

CAMERA = Camera(math.radians(60), 256)
ROWS, COLUMNS = np.divmod(np.arange(CAMERA.pixels**2), CAMERA.pixels)
# In parts so small that linear algebra stays on one thread: with other tests beside it, more take many times as long.
CENTRES = np.split(np.column_stack([COLUMNS, ROWS]) + 0.5, 8)


def hidden_in_image(world: World, pose: Pose) -> np.ndarray:
    """Mask of pixels that show a tree."""
    trees = np.array([body.id for body in world.bodies if body.kind in ("canopy", "trunk")])
    return np.isin(capture(world.client, CAMERA, pose)[2], trees).ravel()


def hidden_by_geometry(forest: Forest, pose: Pose) -> np.ndarray:
    """Mask of pixels with the ground at their middle out of sight."""
    ground = np.vstack([CAMERA.ground_points(pose, part) for part in CENTRES])
    return ~forest.visible(pose.position, np.column_stack([ground, np.zeros(len(ground))]))[0]


def test_image_and_line_of_sight_hide_the_same_ground_in_200_views():
    rng = np.random.default_rng(0)
    counts = []
    for count, radius in ((28, 5.0), (100, 1.0), (55, 3.0), (36, 4.0)):
        forest = random_forest(rng, count, radius)
        with World(SCENARIO, forest, 0) as world:
            for k in range(50):
                place = [*rng.uniform(-35, 35, 2), rng.choice(ALTITUDES)]
                pose = Pose.level(*place) if k % 2 else tilted(rng, place, 0.35)
                shown, known = hidden_in_image(world, pose), hidden_by_geometry(forest, pose)
                counts.append((np.sum(shown & known), np.sum(shown | known)))
    both, either = np.array(counts).T
    assert both.sum() / either.sum() >= 0.998
    # A view with little in it is decided by a few pixels.
    large = either > 1000
    assert np.mean(large) > 0.9
    assert np.min(both[large] / either[large]) >= 0.99
