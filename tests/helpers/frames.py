"""Rendered frames and the count of what is found in them."""

import math
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from helpers.scenes import OPEN
from helpers.views import ALTITUDES, CAMERA, SCENARIO
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.assignment import pairs_within

MARGIN = 16  # pixels around the image in which people cut by its edge are seen whole
WIDE = Camera(2 * math.atan((CAMERA.pixels / 2 + MARGIN) / CAMERA.focal), CAMERA.pixels + 2 * MARGIN)


def frame(image, pose, camera=CAMERA, forest=None):
    return Frame(0, 0.0, camera, pose, np.ascontiguousarray(image), forest)


@contextmanager
def photographed(people=1, forest=OPEN, scenario=SCENARIO):
    """A function that places people (N, 2) m, and gives the rendered view of them and the detections in it."""
    with World(scenario, forest, people) as world:
        renderer = Renderer(world)

        def shoot(pose, places, headings, camera=CAMERA, known=None):
            world.place_people(np.atleast_2d(places), np.atleast_1d(headings))
            rendered = renderer.render(camera, pose)
            return rendered, BlobDetector().detect(frame(rendered.image, pose, camera, known))

        yield shoot


def touching(people, count):
    """Flags (count,) of silhouettes that meet another person's, corners included."""
    padded = np.pad(people, 1, constant_values=-1)
    n = len(people)
    touch = np.zeros(count, dtype=bool)
    for i, j in np.ndindex(3, 3):
        other = padded[i : i + n, j : j + n]
        meet = (people >= 0) & (other >= 0) & (people != other)
        touch[people[meet]] = True
    return touch


@dataclass
class Tally:
    """Results of people half visible or more that touch no other person, and of all detections."""

    people: list  # found, off-nadir angle in degrees, radial and tangential error in m
    detections: list  # whether a person was there

    def count(self, found, places, pose, scene, alone):
        """Match detections to people; scene and alone are label images with trees, and without and enlarged."""
        n = len(places)
        visible = np.bincount(scene[scene >= 0], minlength=n)
        whole = np.bincount(alone[alone >= 0], minlength=n)
        touch = touching(alone, n)
        distance = np.linalg.norm(found.ground[:, None] - places, axis=2)
        distance[:, visible == 0] = np.inf
        pairs = {column: row for row, column in pairs_within(distance, 1.0)}
        for k in np.flatnonzero((visible > 0) & (2 * visible >= whole) & ~touch):
            offset = places[k] - pose.position[:2]
            radial = offset / np.linalg.norm(offset)
            angle = math.degrees(math.atan2(np.linalg.norm(offset), pose.position[2] - TARGET_HEIGHT))
            error = found.ground[pairs[k]] - places[k] if k in pairs else np.full(2, np.nan)
            self.people.append((k in pairs, angle, error @ radial, error @ [-radial[1], radial[0]]))
        for row in range(len(found.ground)):
            if np.isinf(distance[row]).all() or not touch[np.argmin(distance[row])]:
                self.detections.append(row in pairs.values())


def survey(tally, rng, forest, frames, scenario=SCENARIO, seed=0):
    """Detect in random frames over a forest, with eight people anywhere in the image and across its edges."""
    with World(scenario, forest, 8, seed) as world, World(SCENARIO, OPEN, 8) as bare:
        full, alone = Renderer(world), Renderer(bare)
        for k in range(frames):
            pose = Pose.level(*rng.uniform(-30, 30, 2), rng.choice(ALTITUDES))
            half = pose.position[2] * math.tan(CAMERA.fov / 2) + 0.5
            places = pose.position[:2] + rng.uniform(-half, half, (8, 2))
            headings = rng.uniform(-math.pi, math.pi, 8)
            for each in (world, bare):
                each.place_people(places, headings)
            taken = full.take(0, k / 5, CAMERA, pose)
            found = BlobDetector().detect(frame(taken.image, pose))
            tally.count(found, places, pose, taken.people, alone.render(WIDE, pose).people)
