"""Rendered people for the fit of the camera's covariance, and the truth about them."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from sim.scenario.environment import Area, Trees
from sim.scenario.fleet import DEFAULT_FLEET, Uav
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import camera_pose
from sim.sensing.renderer import Renderer
from sim.world.forest import grow
from sim.world.world import World
from tracking.detection.blob_detector import blobs_of
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import TARGET_HEIGHT, Forest
from tracking.numerics.arrays import Array

ALTITUDES = tuple(uav.altitude for uav in DEFAULT_FLEET)
# Off nadir, and up to which roll and pitch of a body that the camera is fixed to; 0 for a gimbal [deg].
TILTS = ((0.0, 20.0), (15.0, 0.0), (15.0, 20.0), (30.0, 0.0), (45.0, 0.0))
_PEOPLE = 8
_GAP = 2.4  # m between people
_MARGIN = 0.5  # m beyond the image where people may stand
FLAT = 0.17  # slope of the lines of sight to people towards the horizon: some 100 m away
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
_PLAIN = 0.15  # of the people in plain view are kept: the others tell more
# Points of a body, to find people that are hidden in part.
_BODY = np.array(
    [
        (0.2 * math.cos(a), 0.2 * math.sin(a), h)
        for h in (0.1, 0.5, 0.9, 1.3, 1.6)
        for a in np.linspace(0.0, 2 * math.pi, 8, endpoint=False)
    ]
)


@dataclass(frozen=True, eq=False)
class Sample:
    """One detected person: what the camera saw of them, and the truth."""

    frame: Frame
    forest: Forest
    blobs: list[Array]  # (K, 2) pixels: the one that stands for them, then others of the same component
    person: Array  # (2,) m
    hidden: float  # share of the silhouette that trees or the image's edge hide

    @property
    def blob(self) -> Array:
        """Pixels (K, 2) that stand for the person."""
        return self.blobs[0]

    @property
    def tangent(self) -> float:
        """Tangent of the angle off nadir."""
        offset = self.person - self.frame.pose.position[:2]
        return float(np.linalg.norm(offset)) / (float(self.frame.pose.position[2]) - TARGET_HEIGHT)


def samples(
    rng: np.random.Generator,
    forest: Forest,
    *,
    frames: int,
    pixels: int = 128,
    altitudes: Sequence[float] = ALTITUDES,
    attitudes: Sequence[Array] = (LEVEL,),
) -> Iterator[Sample]:
    """People detected in random frames over one forest, as often near the image's centre as far from it.

    attitudes: of the camera, quaternions (4,) that the frames have in turn.
    """
    scenario = Scenario(uavs=(Uav(start=(74.0, 49.0)),))
    camera = Camera(math.radians(60), pixels)
    margin = pixels // 8
    wide = Camera(2 * math.atan((pixels / 2 + margin) / camera.focal), pixels + 2 * margin)
    with World(scenario, forest, _PEOPLE) as world, World(scenario, Forest(()), _PEOPLE) as bare:
        full, alone = Renderer(world), Renderer(bare)
        for k in range(frames):
            x, y = rng.uniform(-30.0, 30.0, 2).tolist()
            pose = Pose(np.array([x, y, altitudes[k % len(altitudes)]]), attitudes[k % len(attitudes)])
            people = _people(rng, camera, pose, forest)
            headings = rng.uniform(-math.pi, math.pi, _PEOPLE)
            for each in (world, bare):
                each.place_people(people, headings)
            rendered = full.render(camera, pose)
            frame = Frame(0, 0.0, camera, pose, rendered.image)
            whole = alone.render(wide, pose).people
            blobs, components = blobs_of(frame)
            for i, blob in enumerate(blobs):
                owners = rendered.people[tuple((blob[:, ::-1] - 0.5).astype(int).T)]
                person = int(np.bincount(owners[owners >= 0]).argmax())
                hidden = 1.0 - np.sum(rendered.people == person) / np.sum(whole == person)
                others = [blobs[j] for j in np.flatnonzero(components == components[i]) if j != i]
                yield Sample(frame, forest, [blob, *others], people[person], float(hidden))


def _people(rng: np.random.Generator, camera: Camera, pose: Pose, forest: Forest) -> Array:
    height = float(pose.position[2]) - TARGET_HEIGHT
    half = height * math.tan(camera.fov / 2) + _MARGIN
    people: list[Array] = []
    seen: list[tuple[Array, float]] = []
    while len(people) < _PEOPLE:
        # Where a level camera would see the ground; whatever the attitude, people keep their distance in the image.
        r, bearing = rng.uniform(0, half * math.sqrt(2)), rng.uniform(-math.pi, math.pi)
        offset = r * np.array([math.cos(bearing), math.sin(bearing)])
        pixel = camera.pixels / 2 + camera.focal / height * offset * [1.0, -1.0]
        ray = camera.rays(pose, pixel)[0]
        if np.abs(offset).max() > half or -ray[2] < FLAT * np.linalg.norm(ray):
            continue
        place, depth = camera.ground_points(pose, pixel, TARGET_HEIGHT)[0], -height / ray[2]
        if any(np.linalg.norm(pixel - p) * min(depth, d) < _GAP * camera.focal for p, d in seen):
            continue
        share = forest.visible(pose.position, _BODY + np.append(place, 0.0)).mean() if forest.trees else 0.5
        if 0.0 < share < 1.0 or (share == 1.0 and rng.random() < _PLAIN):
            people.append(place)
            seen.append((pixel, depth))
    return np.array(people)


def _forests(seed: int) -> Iterator[Forest]:
    for k, (density, radius) in enumerate(((60.0, 1.5), (40.0, 2.5), (15.0, 5.0), (15.0, 5.0))):
        trees = Trees(density=density, canopy_radius=radius)
        yield Forest(grow(trees, Area(80.0, 80.0), np.random.default_rng([seed, k])).trees)


def people_in_forests(seed: int, frames: int, pixels: int = 128, attitudes: Sequence[Array] = (LEVEL,)) -> list[Sample]:
    """Samples from `frames` frames over each of four forests."""
    out: list[Sample] = []
    for k, forest in enumerate(_forests(seed)):
        rng = np.random.default_rng([seed, 1, k])
        out += samples(rng, forest, frames=frames, pixels=pixels, attitudes=attitudes)
    return out


def tilted(rng: np.random.Generator, tilt_deg: float, count: int, sway_deg: float = 0.0) -> list[Array]:
    """Quaternions (4,) of cameras mounted at an angle off nadir, on a gimbal or, if it sways, on a body.

    The body has any heading, and roll and pitch up to `sway_deg`.
    """
    uav = Uav(start=(0.0, 0.0), mount="body" if sway_deg else "gimbal", tilt_deg=tilt_deg)
    angles = rng.uniform([-180.0, -sway_deg, -sway_deg], [180.0, sway_deg, sway_deg], (count, 3))
    bodies = Rotation.from_euler("ZYX", angles, degrees=True).as_quat()
    return [camera_pose(uav, Pose(np.zeros(3), body)).quaternion for body in bodies]
