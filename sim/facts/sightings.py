"""People in one camera at one scan: their states there, and the trees that hide them."""

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from sim.mission.recording import Recording
from tracking.errors import list_numbers
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.line_of_sight import Raster, value_at
from tracking.geometry.visibility import Forest, at_target_height, detectable_shares
from tracking.numerics.arrays import Array, Flags, Indices

NO_TREE = "though no tree is in the way"  # the person is too small, or another person or a UAV covers them
# The states of a person in a camera's frame, from the worst to the best. Everything that tells them in words takes them
# from here. Without a frame, "in view" stands for the last two.
STATES = (
    "absent",
    "out of view",
    "hidden",  # the frame contains their mid-height, but shows nothing of them
    "missed",  # the frame shows a part of them, but they were not detected
    "seen",  # they were detected
)


def find_states(inside: Flags | bool, shown: Flags | bool, detected: Flags | bool) -> Indices:
    """States of people who are present in frames, as indices into `STATES`, from three masks of one shape."""
    return np.where(detected, 4, np.where(shown, 3, np.where(inside, 2, 1)))


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
    def state(self) -> str:
        """One of `STATES`; without a frame, "in view" if one would have shown the person."""
        if math.isnan(self.place[0]):
            return "absent"
        state = STATES[find_states(self.inside, self.pixels > 0, self.detected)]
        return state if self.looked or state != "missed" else "in view"

    @property
    def status(self) -> str:
        """The state in words, with the trees or the edge that hide a part of the person."""
        state, trees = self.state, list_numbers("tree", list(self.hidden_by)) if self.hidden_by else ""
        free = math.prod(1.0 - share for share in self.hidden_by.values())
        part = f"{100 * (1.0 - free):.0f} %" if free > 0.0 else "partly"
        if state == "hidden":
            if not trees:
                return f"hidden, {NO_TREE}"
            return f"hidden, {part} by {trees}" if free > 0.0 else f"hidden by {trees}"
        if not self.in_image:
            return state
        if not self.inside:
            return f"{state}, cut by the edge"
        return f"{state}, {part} hidden by {trees}" if trees else state


def find_sightings(recording: Recording, k: int, uav: int, camera: Camera) -> tuple[Sighting, ...]:
    """All people in a camera at the pose of a UAV's camera at scan k."""
    pose = recording.camera_at(k, uav)
    people = recording.people[k]
    looked = bool(recording.frames_taken[k, uav])
    inside, hiding = find_inside_and_hiding(camera, pose, people, recording.hiding_forest)
    pixels = recording.visible[k, uav] if looked else inside & _would_show(hiding)
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


def tell_pose_error(recording: Recording, k: int, uav: int) -> list[str]:
    """How far the pose that a UAV believes its camera to have is from the true one, in a line; none if it is exact."""
    true, believed = recording.camera_at(k, uav), recording.believed_camera_at(k, uav)
    if recording.believed is None or np.array_equal(recording.believed[k, uav], recording.cameras[k, uav]):
        return []
    from scipy.spatial.transform import Rotation

    away = believed.position - true.position
    turned = Rotation.from_quat(believed.quaternion) * Rotation.from_quat(true.quaternion).inv()
    angle = math.degrees(turned.magnitude())
    return [f"believed pose {math.hypot(*away[:2]):.2f} m off, {away[2]:+.2f} m in height, turned by {angle:.1f}°"]


def tell_map_error(recording: Recording, k: int, uav: int, person: int) -> list[str]:
    """What a UAV's believed map says of a person's place, in a line; none if the true trees say the same."""
    believed = recording.believed_at(k, uav)
    if believed.trees == recording.forest.trees and not isinstance(believed.unknown, Raster):
        return []
    place, setting = recording.people[k, person], recording.setting
    true = tell_sight(setting.true_camera(uav), recording.camera_at(k, uav), place, recording.hiding_forest)
    pose = recording.believed_camera_at(k, uav)
    told = tell_sight(setting.believed_camera(uav), pose, place, believed)
    if told == "in view" and isinstance(believed.unknown, Raster) and value_at(believed.grid.unknown, *place.tolist()):
        told = "on ground not yet seen"
    states = [text.partition(" by ")[0] for text in (true, told)]
    return [f"{states[1]} by the map that UAVs believe"] if states[0] != states[1] else []


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
        if frames and states.pop("out of view", 0) == frames:
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
        return "out of view"
    return "in view" if _would_show(hiding)[0] else f"hidden by tree {hiding[0].argmax()}"


def _would_show(hiding: Array) -> Flags:
    """Whether people (M,) would rather show than not behind trees, which hide shares (M, T) of their lines of sight."""
    return np.asarray(detectable_shares(np.prod(1.0 - hiding, axis=1)) >= 0.5)


def find_inside_and_hiding(camera: Camera, pose: Pose, people: Array, forest: Forest) -> tuple[Flags, Array]:
    """Mask (M,) of people (M, 2) m, NaN if absent, inside a frame, and shares (M, T) of them that each tree hides."""
    points = at_target_height(np.nan_to_num(people))
    inside = ~np.isnan(people[:, 0]) & camera.sees(pose, points)
    hiding = np.zeros((len(points), len(forest.trees)))
    hiding[inside] = forest.shares_hidden(pose.position, points[inside])
    return inside, hiding
