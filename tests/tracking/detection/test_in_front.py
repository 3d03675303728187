"""People in front of a trunk: they are not hidden, and are located as well as in the open."""

import math

import numpy as np
from helpers.views import SCENARIO

from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree


def test_a_trunk_hides_no_person_nearer_to_the_camera():
    rng, camera = np.random.default_rng(0), Camera(math.radians(60), 128)
    errors, nees = [], []
    for _ in range(30):
        bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(4.0, 9.0)
        away = np.array([math.cos(bearing), math.sin(bearing)])
        # A canopy as thin as the trunk, so that nothing else hides them.
        forest = Forest((Tree(*(distance * away), canopy_radius=0.2),))
        with World(SCENARIO, forest, 1) as world:
            renderer = Renderer(world)
            for _ in range(10):
                place = (distance - rng.uniform(0.35, 0.5)) * away
                world.place_people(place[None], rng.uniform(-math.pi, math.pi, 1))
                pose = Pose.level(0.0, 0.0, rng.uniform(17.0, 22.0))
                found = BlobDetector(forest).detect(Frame(0, 0.0, camera, pose, renderer.render(camera, pose).image))
                assert len(found.ground) == 1
                error = found.ground[0] - place
                errors.append([error @ away, error @ [-away[1], away[0]]])
                nees.append(error @ np.linalg.solve(found.covariances[0], error))
    assert np.abs(np.mean(errors, axis=0)).max() < 0.04
    assert 1.2 < np.mean(nees) < 2.8
