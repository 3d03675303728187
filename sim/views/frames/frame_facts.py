"""What the picture of one camera's frame shows: people, marks, and outlines of what trees hide."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from sim.facts.sightings import Sighting, find_sightings
from sim.mission.recording import Recording
from sim.sensing.culling import NEAR_PLANE
from sim.views.scene import DetectionMark, TrackMark, mark_detections, mark_tracks
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array

_TURN = np.linspace(0.0, 2 * math.pi, 128, endpoint=False)


@dataclass(frozen=True, eq=False)
class FrameFacts:
    """One camera's view with ground truth."""

    uav: int
    time: float  # s
    camera: Camera
    pose: Pose
    # as the UAV takes camera and pose to be; pictures show measurements and tracks from there
    believed_camera: Camera
    believed: Pose
    forest: Forest
    mapped: Forest | None  # what the UAV believes of the forest, if UAVs map trees themselves
    people: tuple[Sighting, ...]
    detections: tuple[DetectionMark, ...]
    tracks: tuple[TrackMark, ...]


def make_frame_facts(recording: Recording, k: int, uav: int) -> FrameFacts:
    """The view of one UAV at scan k."""
    own = recording.setting.uavs[uav]
    people = find_sightings(recording, k, uav, own.true_camera)
    if recording.setting.sensing.field_of_view == "unlimited":  # people seen beyond the image are not in it
        people = tuple(replace(p, pixels=p.pixels * p.inside, detected=p.detected and p.inside) for p in people)
    return FrameFacts(
        uav=uav,
        time=float(recording.times[k]),
        camera=own.true_camera,
        pose=recording.camera_at(k, uav),
        believed_camera=own.believed_camera,
        believed=recording.believed_camera_at(k, uav),
        forest=recording.hiding_forest,
        mapped=None if recording.maps is None else recording.believed_at(k, uav),
        people=people,
        detections=mark_detections(recording.scan_at(k, uav), recording.pixels_at(k, uav)),
        tracks=mark_tracks(recording.tracks_at(k, uav), recording.track_numbers),
    )


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
