"""Rendered people for the fit of the camera's covariance, with ground truth."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from sim.scenario.scenario import Scenario
from sim.scenario.uavs import DEFAULT_FLEET, Uav
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.blob_detector import find_blobs
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array

ALTITUDES = tuple(uav.altitude for uav in DEFAULT_FLEET)
# Mounting angle off nadir, and largest roll and pitch of the body, which is 0 for a gimbal [deg].
TILTS = ((0.0, 20.0), (15.0, 0.0), (15.0, 20.0), (30.0, 0.0), (45.0, 0.0))
_PEOPLE = 8
_GAP = 2.4  # m, least distance between people
_MARGIN = 0.5  # m beyond the image in which people may stand
_FLAT = 0.17  # least slope of lines of sight to people, at a distance of some 100 m
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
_PLAIN = 0.15  # share of the people in plain view that is kept; the others are more informative
# Points of a body, by which partly hidden people are found.
_BODY = np.array(
    [
        (0.2 * math.cos(a), 0.2 * math.sin(a), h)
        for h in (0.1, 0.5, 0.9, 1.3, 1.6)
        for a in np.linspace(0.0, 2 * math.pi, 8, endpoint=False)
    ]
)


@dataclass(frozen=True, eq=False)
class Sample:
    """One detected person: the camera's pixels of them, and the truth."""

    frame: Frame
    forest: Forest
    blobs: list[Array]  # (K, 2) pixels: the person's blob, then the others of its component
    person: Array  # (2,) m
    hidden: float  # share of the silhouette that trees or the image's edge hide

    @property
    def blob(self) -> Array:
        """Pixels (K, 2) of the person."""
        return self.blobs[0]

    @property
    def tangent(self) -> float:
        """Tangent of the angle off nadir."""
        offset = self.person - self.frame.pose.position[:2]
        return float(np.linalg.norm(offset)) / (float(self.frame.pose.position[2]) - TARGET_HEIGHT)


@dataclass(frozen=True, eq=False)
class Pair:
    """Two people that touch in the image and that the detector told apart, and the truth."""

    frame: Frame
    blobs: list[Array]  # two blobs, (K, 2) pixels
    components: NDArray[np.int64]  # (2,) as from `find_blobs`
    people: Array  # (2, 2) m, in the order of the blobs


def draw_samples(
    rng: np.random.Generator,
    forest: Forest,
    *,
    frames: int,
    pixels: int = 128,
    altitudes: Sequence[float] = ALTITUDES,
    attitudes: Sequence[Array] = (LEVEL,),
    leaves: int = 0,
) -> Iterator[Sample]:
    """People detected in random frames over one forest, at all distances from the image's centre equally often.

    attitudes: attitudes of the camera, quaternions (4,) that the frames have in turn; leaves: the seed of leaves.
    """
    scenario = Scenario(uavs=(Uav(start=(74.0, 49.0)),))
    camera = Camera(math.radians(60), pixels)
    margin = pixels // 8
    wide = Camera(2 * math.atan((pixels / 2 + margin) / camera.focal), pixels + 2 * margin)
    with World(scenario, forest, _PEOPLE, leaves) as world, World(scenario, Forest(()), _PEOPLE) as bare:
        full, alone = Renderer(world), Renderer(bare)
        for k in range(frames):
            x, y = rng.uniform(-30.0, 30.0, 2).tolist()
            pose = Pose(np.array([x, y, altitudes[k % len(altitudes)]]), attitudes[k % len(attitudes)])
            people = _draw_people(rng, camera, pose, forest)
            headings = rng.uniform(-math.pi, math.pi, _PEOPLE)
            for each in (world, bare):
                each.place_people(people, headings)
            rendered = full.render(camera, pose)
            frame = Frame(0, 0.0, camera, pose, rendered.image, forest)
            whole = alone.render(wide, pose).people
            blobs, components = find_blobs(frame)
            for i, blob in enumerate(blobs):
                owners = rendered.people[tuple((blob[:, ::-1] - 0.5).astype(int).T)]
                person = int(np.bincount(owners[owners >= 0]).argmax())
                hidden = 1.0 - np.sum(rendered.people == person) / np.sum(whole == person)
                others = [blobs[j] for j in np.flatnonzero(components == components[i]) if j != i]
                yield Sample(frame, forest, [blob, *others], people[person], float(hidden))


def _draw_people(rng: np.random.Generator, camera: Camera, pose: Pose, forest: Forest) -> Array:
    height = float(pose.position[2]) - TARGET_HEIGHT
    half = height * math.tan(camera.fov / 2) + _MARGIN
    people: list[Array] = []
    seen: list[tuple[tuple[float, float], float]] = []
    middle, focal, turn = camera.pixels / 2, camera.focal, pose.rotation
    while len(people) < _PEOPLE:
        # Places are drawn for a level camera and then tilted, so that distances in the image do not depend on attitude.
        r, bearing = rng.uniform(0, half * math.sqrt(2)), rng.uniform(-math.pi, math.pi)
        x, y = r * math.cos(bearing), r * math.sin(bearing)
        if max(abs(x), abs(y)) > half:
            continue
        ray = turn @ [x / height, y / height, -1.0]
        if -ray[2] < _FLAT * math.hypot(*ray):
            continue
        pixel, depth = (middle + focal / height * x, middle - focal / height * y), -height / ray[2]
        place = pose.position[:2] + depth * ray[:2]
        if any(math.dist(pixel, p) * min(depth, d) < _GAP * focal for p, d in seen):
            continue
        share = forest.free_shares(pose.position, _BODY + np.append(place, 0.0)).mean() if forest.trees else 0.5
        if 0.0 < share < 1.0 or (share == 1.0 and rng.random() < _PLAIN):
            people.append(place)
            seen.append((pixel, depth))
    return np.array(people)


def draw_pairs(rng: np.random.Generator, *, frames: int, attitudes: Sequence[Array] = (LEVEL,)) -> Iterator[Pair]:
    """Pairs that touch and were told apart, in frames in the open with random distances, headings and places."""
    camera = Camera(math.radians(60), 128)
    with World(Scenario(uavs=(Uav(start=(74.0, 49.0)),)), Forest(()), 2) as world:
        renderer = Renderer(world)
        for k in range(frames):
            pose = Pose(np.array([0.0, 0.0, ALTITUDES[k % len(ALTITUDES)]]), attitudes[k % len(attitudes)])
            pixel, bearing = rng.uniform(8.0, camera.pixels - 8.0, 2), rng.uniform(-math.pi, math.pi)
            ray = camera.rays(pose, pixel)[0]
            if -ray[2] < _FLAT * np.linalg.norm(ray):
                continue
            first = camera.ground_points(pose, pixel, TARGET_HEIGHT)[0]
            # From shoulder to shoulder up to the distance at which one person still hides the other.
            gap = rng.uniform(0.45, 1.0 + 1.7 * float(np.linalg.norm(ray[:2]) / -ray[2]))
            people = np.array([first, first + gap * np.array([math.cos(bearing), math.sin(bearing)])])
            world.place_people(people, rng.uniform(-math.pi, math.pi, 2))
            rendered = renderer.render(camera, pose)
            frame = Frame(0, 0.0, camera, pose, rendered.image, Forest(()))
            blobs, components = find_blobs(frame)
            if len(blobs) == 2 and components[0] == components[1] and _touch(rendered.people):
                yield Pair(frame, blobs, components, people[_find_owners(frame, blobs, people)])


def _touch(people: NDArray[np.int32]) -> bool:
    """True if two people form one component of a mask (H, W) that the image's edge does not cut."""
    shown = people >= 0
    edge = np.any(shown[[0, -1]]) or np.any(shown[:, [0, -1]])
    return len(np.unique(people)) == 3 and not edge and cv2.connectedComponents(shown.astype(np.uint8))[0] == 2


def _find_owners(frame: Frame, blobs: list[Array], people: Array) -> list[int]:
    """Person of each of two blobs, such that the sum of distances from their middles to the people is least."""
    middles = np.array([blob.mean(axis=0) for blob in blobs])
    ground = frame.camera.ground_points(frame.pose, middles, TARGET_HEIGHT)
    gaps = np.linalg.norm(ground[:, None] - people, axis=2)
    return [0, 1] if gaps[0, 0] + gaps[1, 1] <= gaps[0, 1] + gaps[1, 0] else [1, 0]


def draw_tilted_attitudes(rng: np.random.Generator, tilt_deg: float, count: int, sway_deg: float = 0.0) -> list[Array]:
    """Quaternions (4,) of cameras mounted at an angle off nadir, on a gimbal or, if it sways, on a body.

    The body has any heading, and roll and pitch up to `sway_deg`.
    """
    uav = Uav(start=(0.0, 0.0), mount="body" if sway_deg else "gimbal", tilt_deg=tilt_deg)
    angles = rng.uniform([-180.0, -sway_deg, -sway_deg], [180.0, sway_deg, sway_deg], (count, 3))
    bodies = Rotation.from_euler("ZYX", angles, degrees=True).as_quat()
    return [uav.camera_pose(Pose(np.zeros(3), body)).quaternion for body in bodies]
