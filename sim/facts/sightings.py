"""The view of one camera at one scan: people shown, trees that hide people, and outlines of hidden ground."""

import math
from collections import Counter
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from sim.facts.words import number_snapshot
from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot
from sim.sensing.culling import NEAR_PLANE
from tracking.errors import list_numbers
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, at_target_height, detectable_shares
from tracking.numerics.arrays import Array, Flags

NO_TREE = "though no tree is in the way"  # the person is too small, or another person or a UAV covers them
_OUT = "out of view"  # the place of a track in a frame
_IN_VIEW = "in view but not detected"
_TURN = np.linspace(0.0, 2 * math.pi, 128, endpoint=False)


@dataclass(frozen=True)
class Sighting:
    """One true person in one camera."""

    person: int
    place: tuple[float, float]  # m; NaN if absent
    inside: bool  # the mid-height lies inside the image, hidden or not
    # Trees between the camera and the mid-height, if inside, and the share that each hides: 1 if it is opaque.
    hidden_by: dict[int, float]
    pixels: int  # shown by the renderer; 1 for seen in ideal sensing and where the camera took no frame
    detected: bool
    looked: bool = True  # the camera took a frame

    @property
    def in_image(self) -> bool:
        """True if a part of the person is in the image, or would be if nothing hid it."""
        return self.inside or self.pixels > 0

    @property
    def status(self) -> str:
        """The person's state in the camera, in words."""
        if math.isnan(self.place[0]):
            return "absent"
        if not self.inside:
            return "cut by the edge" if self.pixels else "outside the view"
        if self.hidden_by:
            free = math.prod(1.0 - share for share in self.hidden_by.values())
            part = f"{100 * (1.0 - free):.0f} % " if free > 0.0 else "partly " * bool(self.pixels)
            return f"{part}hidden by {list_numbers('tree', list(self.hidden_by))}"
        return "in view" if self.pixels else f"not shown, {NO_TREE}"


@dataclass(frozen=True, eq=False)
class FrameFacts:
    """Facts about one camera's view with ground truth; tracks are numbered as in the film."""

    camera: Camera
    believed_camera: Camera  # as the UAV takes it to be, through which it sees measurements and tracks
    forest: Forest
    snapshot: Snapshot
    uav: int
    people: tuple[Sighting, ...]

    @property
    def pose(self) -> Pose:
        """The camera's pose."""
        return self.snapshot.cameras[self.uav]

    @property
    def believed(self) -> Pose:
        """The camera's pose as the UAV believes it; pictures show measurements and tracks from there."""
        return (self.snapshot.believed or self.snapshot.cameras)[self.uav]


def find_sightings(recording: Recording, k: int, uav: int, camera: Camera) -> tuple[Sighting, ...]:
    """All people in a camera at the pose of a UAV's camera at scan k."""
    pose = recording.camera_at(k, uav)
    people = recording.people[k]
    looked = bool(recording.frames_taken[k, uav])
    inside, hiding = find_inside_and_hiding(camera, pose, people, recording.hiding_forest)
    # Without a frame, geometry decides who would rather have been shown than not.
    free = detectable_shares(np.prod(1.0 - hiding, axis=1))
    pixels = recording.visible[k, uav] if looked else inside & (free >= 0.5)
    return tuple(
        Sighting(
            person=m,
            place=(float(people[m, 0]), float(people[m, 1])),
            inside=bool(inside[m]),
            hidden_by={tree: float(hiding[m, tree]) for tree in np.flatnonzero(hiding[m]).tolist()},
            pixels=int(pixels[m]),
            detected=bool(recording.matched[k, uav, m]),
            looked=looked,
        )
        for m in range(len(people))
    )


def make_frame_facts(recording: Recording, k: int, uav: int) -> FrameFacts:
    """The view of one UAV at scan k."""
    camera = recording.setting.uavs[uav].true_camera
    people = find_sightings(recording, k, uav, camera)
    if recording.setting.sensing.field_of_view == "unlimited":  # people seen beyond the image are not in it
        people = tuple(replace(p, pixels=p.pixels * p.inside) for p in people)
    believed = recording.setting.uavs[uav].believed_camera
    return FrameFacts(camera, believed, recording.hiding_forest, number_snapshot(recording, k), uav, people)


def tell_pose_error(recording: Recording, k: int, uav: int) -> list[str]:
    """How far the pose that a UAV believes its camera to have is from the true one, in a line; none if it is exact."""
    true, believed = recording.camera_at(k, uav), recording.believed_camera_at(k, uav)
    if recording.believed is None or np.array_equal(recording.believed[k, uav], recording.cameras[k, uav]):
        return []
    away = believed.position - true.position
    turned = Rotation.from_quat(believed.quaternion) * Rotation.from_quat(true.quaternion).inv()
    angle = math.degrees(turned.magnitude())
    return [f"believed pose {math.hypot(*away[:2]):.2f} m off, {away[2]:+.2f} m in height, turned by {angle:.1f}°"]


def tell_fade(recording: Recording, id_: int, last: int) -> str:
    """The frames since a track's last detection, until its last scan, in words; empty if that detected it, or unknown.

    The place of the track's mean decides what a frame could show.
    """
    rows = np.flatnonzero(recording.track_ids == id_)
    scans, _ = recording.cells(recording.track_offsets)
    _, first = np.unique(scans[rows], return_index=True)
    rows = rows[first]  # that of the first UAV at each scan
    held = dict(zip(scans[rows].tolist(), recording.track_means[rows, :2], strict=True))
    since = float(recording.track_sightings[rows[scans[rows] <= last][-1], 2])
    if math.isnan(since):
        return ""
    parts = []
    away = []
    for i in range(recording.uav_count):
        taken = np.flatnonzero(recording.frames_taken[: last + 1, i] & (recording.times[: last + 1] > since + 1e-9))
        states = Counter(_name_state(recording, k, i, held) for k in taken.tolist() if k in held)
        frames = sum(states.values())
        if frames and states.pop(_OUT, 0) == frames:
            away.append(i)
        for n, (state, count) in enumerate(states.most_common()):
            parts.append(f"{state} in {count}" if n else f"for UAV {i} {state} in {count} of {frames} frames")
    if away:
        parts.append(f"out of view of {list_numbers('UAV', away)}")
    return f"no sure detection since {since:.1f} s, " + ", ".join(parts) if parts else ""


def _name_state(recording: Recording, k: int, uav: int, held: dict[int, Array]) -> str:
    camera = recording.setting.believed_camera(uav)
    return tell_sight(camera, recording.believed_camera_at(k, uav), held[k], recording.hiding_forest)


def tell_sight(camera: Camera, pose: Pose, place: Array, forest: Forest) -> str:
    """How a person at a place (2,) m would show to a camera, in words: out of view, hidden or in view."""
    (inside,), hiding = find_inside_and_hiding(camera, pose, place[None], forest)
    if not inside:
        return _OUT
    (shown,) = detectable_shares(np.prod(1.0 - hiding, axis=1))
    return f"hidden by tree {hiding[0].argmax()}" if shown < 0.5 else _IN_VIEW


def find_inside_and_hiding(camera: Camera, pose: Pose, people: Array, forest: Forest) -> tuple[Flags, Array]:
    """Mask (M,) of people (M, 2) m, NaN if absent, inside a frame, and shares (M, T) of them that each tree hides."""
    points = at_target_height(np.nan_to_num(people))
    inside = ~np.isnan(people[:, 0]) & camera.sees(pose, points)
    hiding = np.zeros((len(points), len(forest.trees)))
    hiding[inside] = forest.shares_hidden(pose.position, points[inside])
    return inside, hiding


def outline_hidden_ground(camera: Camera, pose: Pose, forest: Forest) -> list[list[Array]]:
    """Outlines in the image, pixels (N, 2), of the area at `TARGET_HEIGHT` that the blockers of each tree hide.

    A camera above does not see a point at this height if the part of a blocker above this height covers it.
    """
    found: list[list[Array]] = [[] for _ in forest.trees]
    for tree, cylinder in zip(forest.tree_of_blockers.tolist(), forest.blockers, strict=True):
        x, y, radius, bottom, top = cylinder[:5].tolist()
        if top < TARGET_HEIGHT:
            continue
        outline = outline_cylinder(camera, pose, np.array([x, y, radius, max(bottom, TARGET_HEIGHT), top]))
        if len(outline) and np.all(outline.max(axis=0) > 0) and np.all(outline.min(axis=0) < camera.size):
            found[tree].append(outline)
    return found


def outline_cylinder(camera: Camera, pose: Pose, cylinder: Array) -> Array:
    """Outline in the image, pixels (N, 2), of a vertical cylinder (5,): x, y, radius, bottom, top [m].

    It is the convex hull of the two rims; parts nearer than `NEAR_PLANE` are cut off, so that it may be empty.
    """
    x, y, radius, bottom, top = cylinder.tolist()
    rim = np.column_stack([x + radius * np.cos(_TURN), y + radius * np.sin(_TURN)])
    points = np.vstack([np.column_stack([rim, np.full(len(rim), z)]) for z in (bottom, top)])
    depth = camera.project(pose, points)[1]
    front, behind = points[depth >= NEAR_PLANE], points[depth < NEAR_PLANE]
    if len(front) == 0:
        return np.zeros((0, 2))
    if len(behind):
        excess, lack = depth[depth >= NEAR_PLANE][:, None] - NEAR_PLANE, NEAR_PLANE - depth[depth < NEAR_PLANE]
        share = (excess / (excess + lack))[..., None]
        front = np.vstack([front, (front[:, None] + share * (behind - front[:, None])).reshape(-1, 3)])
    pixels = camera.project(pose, front)[0]
    pixels = pixels[np.isfinite(pixels[:, 0])]  # a lens shows nothing beyond its reach
    if len(pixels) == 0:
        return np.zeros((0, 2))
    return np.asarray(cv2.convexHull(pixels.astype(np.float32))[:, 0], dtype=float)
