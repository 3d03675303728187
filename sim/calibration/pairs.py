"""Rendered pairs of people that the detector told apart, and the truth about them."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.calibration.scenes import ALTITUDES, FLAT, LEVEL
from sim.scenario.fleet import Uav
from sim.scenario.scenario import Scenario
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.blob_detector import blobs_of
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest
from tracking.numerics.arrays import Array


@dataclass(frozen=True, eq=False)
class Pair:
    """Two people touching in the image, as the detector told them apart, and the truth."""

    frame: Frame
    blobs: list[Array]  # two, (K, 2) pixels
    components: NDArray[np.int64]  # (2,) as from `blobs_of`
    people: Array  # (2, 2) m, in the order of the blobs


def pairs(rng: np.random.Generator, *, frames: int, attitudes: Sequence[Array] = (LEVEL,)) -> Iterator[Pair]:
    """Pairs that touch and were told apart, in random frames in the open; distances, headings and places are random."""
    camera = Camera(math.radians(60), 128)
    with World(Scenario(uavs=(Uav(start=(74.0, 49.0)),)), Forest(()), 2) as world:
        renderer = Renderer(world)
        for k in range(frames):
            pose = Pose(np.array([0.0, 0.0, ALTITUDES[k % len(ALTITUDES)]]), attitudes[k % len(attitudes)])
            pixel, bearing = rng.uniform(8.0, camera.pixels - 8.0, 2), rng.uniform(-math.pi, math.pi)
            ray = camera.rays(pose, pixel)[0]
            if -ray[2] < FLAT * np.linalg.norm(ray):
                continue
            first = camera.ground_points(pose, pixel, TARGET_HEIGHT)[0]
            # From shoulder to shoulder to as far as one hides the other.
            gap = rng.uniform(0.45, 1.0 + 1.7 * float(np.linalg.norm(ray[:2]) / -ray[2]))
            people = np.array([first, first + gap * np.array([math.cos(bearing), math.sin(bearing)])])
            world.place_people(people, rng.uniform(-math.pi, math.pi, 2))
            rendered = renderer.render(camera, pose)
            frame = Frame(0, 0.0, camera, pose, rendered.image)
            blobs, components = blobs_of(frame)
            if len(blobs) == 2 and components[0] == components[1] and _touch(rendered.people):
                yield Pair(frame, blobs, components, people[_owners(frame, blobs, people)])


def _touch(people: NDArray[np.int32]) -> bool:
    """True if both of two people show in a mask (P, P), as one component that the image's edge does not cut."""
    shown = people >= 0
    edge = np.any(shown[[0, -1]]) or np.any(shown[:, [0, -1]])
    return len(np.unique(people)) == 3 and not edge and cv2.connectedComponents(shown.astype(np.uint8))[0] == 2


def _owners(frame: Frame, blobs: list[Array], people: Array) -> list[int]:
    """Person of each of two blobs, such that their middles are nearer to the two people together."""
    middles = np.array([blob.mean(axis=0) for blob in blobs])
    ground = frame.camera.ground_points(frame.pose, middles, TARGET_HEIGHT)
    gaps = np.linalg.norm(ground[:, None] - people, axis=2)
    return [0, 1] if gaps[0, 0] + gaps[1, 1] <= gaps[0, 1] + gaps[1, 0] else [1, 0]
