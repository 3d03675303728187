"""Flights in bags of ROS 2: poses and views of cameras, and detections, in the frames of REP 103 and 105."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.ros_bag import CAMERA, IN_IMAGE, ODOMETRY, ON_GROUND, TRANSFORMS, ReadTopic, read_topics
from sim.exchange.values import (
    LoggedCamera,
    LoggedDetection,
    LoggedFrame,
    LoggedUav,
    PoseLog,
    make_calibrated_camera,
    make_square_camera,
)
from sim.scenario.camera_settings import calibrate
from tracking.errors import InputError
from tracking.numerics.arrays import Array

_OF_UAVS = (ODOMETRY, CAMERA, ON_GROUND, IN_IMAGE)


class _Link(NamedTuple):
    """The frame of tf in which another one is, and its poses there, position [m] and quaternion xyzw, by time [s]."""

    parent: str
    poses: dict[float, list[float]]


def find_bag(folder: Path) -> Path | None:
    """The bag in a folder or in one of its own folders; None if there is none."""
    found = sorted([*folder.glob("metadata.yaml"), *folder.glob("*/metadata.yaml")])
    return found[0].parent if found else None


def read_bag(path: Path) -> dict[int, LoggedUav]:
    """Read a bag with a namespace for each UAV, such as /uav0; InputError says what it lacks.

    Each has an Odometry or transforms of tf up to the frame of its camera, a CameraInfo, and a Detection3DArray in the
    world's frame or a Detection2DArray. Times are those of headers. True odometry is left out if there is another one.
    """
    topics = read_topics(path, (*_OF_UAVS, TRANSFORMS))
    names = sorted({_name_uav(name) for name, topic in topics.items() if topic.kind in _OF_UAVS}, key=_split_number)
    if not names:
        raise InputError(f"bag: {path}: has no topics of UAVs; expected {', '.join(_OF_UAVS)}, as /uav0/odometry")
    links = _link_frames(topics)
    roots = set[str]()
    uavs = dict[int, LoggedUav]()
    for i, name in enumerate(names):
        where = f"bag: {path}: {name}"
        own = {topic: found for topic, found in topics.items() if _name_uav(topic) == name}
        info = _choose(where, own, CAMERA)[0]
        camera = _read_camera(info, where)
        poses, root = _trace(links, info.header.frame_id, where)
        kind = ON_GROUND if any(topic.kind == ON_GROUND for topic in own.values()) else IN_IMAGE
        messages = _choose(where, own, kind)
        frames = {message.header.frame_id for message in messages}
        if kind == ON_GROUND and frames - {root}:
            other = f"detections of {name} are in the frame {min(frames)!r}, but tf ends at {root!r}"
            raise InputError(f"bag: {path}: {other}; expected them there")
        uavs[i] = LoggedUav(camera, poses, [_read_frame(message, where) for message in messages])
        roots.add(root)
    if len(roots) > 1:
        raise InputError(f"bag: {path}: UAVs are in different frames of tf: {', '.join(sorted(roots))}")
    return uavs


def _name_uav(topic: str) -> str:
    """The namespace of a topic: /uav0 of /uav0/camera/camera_info."""
    return "/" + topic.strip("/").split("/")[0]


def _split_number(name: str) -> list[tuple[int, str]]:
    """Key by which uav2 comes before uav10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


def _choose(where: str, own: Mapping[str, ReadTopic], kind: str) -> list[Any]:
    """Messages of a UAV's only topic of a type; of several, of the only one that is not of tracks or of the truth."""
    names = [name for name, topic in own.items() if topic.kind == kind]
    if len(names) > 1:
        names = [name for name in names if not re.search("true|truth|track|people", name)]
    if len(names) != 1:
        several = f"has {len(names)} topics" if names else "has no topic"
        raise InputError(f"{where} {several} of {kind}; expected one, among {', '.join(sorted(own))}")
    return own[names[0]].messages


def _read_time(stamp: Any) -> float:  # noqa: ANN401 - messages have types of the bag's own
    """Time [s] of a header's stamp, rounded once."""
    return float((int(stamp.sec) * 10**9 + int(stamp.nanosec)) / 10**9)


def _link_frames(topics: Mapping[str, ReadTopic]) -> dict[str, _Link]:
    """The frames of tf, and those of odometry that tf does not have, by name; true odometry counts least."""
    links: dict[str, _Link] = {}

    def add(message: Any, place: Any, turn: Any) -> None:  # noqa: ANN401 - messages have types of the bag's own
        parent = message.header.frame_id.lstrip("/")
        link = links.setdefault(message.child_frame_id.lstrip("/"), _Link(parent, {}))
        if link.parent == parent:
            pose = [float(value) for value in (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)]
            link.poses.setdefault(_read_time(message.header.stamp), pose)

    for topic in topics.values():
        if topic.kind == TRANSFORMS:
            for link in (link for message in topic.messages for link in message.transforms):
                add(link, link.transform.translation, link.transform.rotation)
    for name in sorted(topics, key=lambda name: ("true" in name or "truth" in name, name)):
        if topics[name].kind == ODOMETRY:
            for message in topics[name].messages:
                add(message, message.pose.pose.position, message.pose.pose.orientation)
    return links


def _trace(links: Mapping[str, _Link], frame: str, where: str) -> tuple[PoseLog, str]:
    """Poses of a camera in the last frame above its own one, and the name of that frame.

    They are at the times of the frame's most frequent link; others are interpolated.
    """
    name = frame.lstrip("/")
    chain = list[PoseLog]()
    while name in links and len(chain) < len(links):
        times, rows = zip(*sorted(links[name].poses.items()), strict=True)
        chain.append(PoseLog(np.array(times), np.array(rows)))
        name = links[name].parent
    if not chain:
        raise InputError(f"{where}: has neither nav_msgs/Odometry nor tf of the frame {frame!r}, which is its camera's")
    instants = max((log.times for log in chain), key=len)
    poses = chain[0].at(instants)
    for log in chain[1:]:
        above = log.at(instants)
        turn = Rotation.from_quat(above[:, 3:])
        attitude = (turn * Rotation.from_quat(poses[:, 3:])).as_quat()
        poses = np.hstack([above[:, :3] + turn.apply(poses[:, :3]), attitude])
    return PoseLog(instants, np.hstack([poses[:, :3], flip(poses[:, 3:])])), name


def flip(quaternions: Array) -> Array:
    """Attitudes (N, 4) xyzw after half a turn about their x axes.

    The turn is that from the axes of `Pose` to a camera's optical ones, y down and z ahead, or back.
    """
    return np.asarray(quaternions[:, ::-1] * (1.0, 1.0, -1.0, -1.0) + 0.0)  # without the sign of zeros


def _read_camera(info: Any, where: str) -> LoggedCamera:  # noqa: ANN401 - messages have types of the bag's own
    """The camera of a CameraInfo; InputError if it is none."""
    k = np.asarray(info.k, dtype=float).tolist()
    bend = np.asarray(info.d, dtype=float).tolist()
    try:
        settings = calibrate((int(info.width), int(info.height)), k, bend, info.distortion_model)
    except ValueError as error:
        raise InputError(f"{where}: its CameraInfo: {error}") from error
    width, (fx, fy) = settings.width, settings.focal or (0.0, 0.0)
    centred = math.isclose(k[2] + 0.5, width / 2) and k[2] == k[5]
    if width == settings.height and fx == fy and centred and not any(bend):
        return make_square_camera(math.degrees(2 * math.atan(width / 2 / fx)), width)
    return make_calibrated_camera(settings)


def _read_frame(message: Any, where: str) -> LoggedFrame:  # noqa: ANN401 - messages have types of the bag's own
    time = _read_time(message.header.stamp)
    return LoggedFrame(time, f"{where}, {time:.3f} s", [_read_detection(found) for found in message.detections])


def _read_detection(found: Any) -> LoggedDetection:  # noqa: ANN401 - messages have types of the bag's own
    """A detection in the image, or on the ground with the covariance of its first result, if that has one."""
    centre = found.bbox.center
    if not hasattr(found.bbox, "size"):  # of a Detection2D; older ones have x and y in the centre itself
        place = getattr(centre, "position", centre)
        return LoggedDetection(pixel=(float(place.x), float(place.y)))
    place = centre.position
    covariance = (math.nan, math.nan, math.nan)
    if len(found.results):
        first = found.results[0].pose
        entries = np.asarray(first.covariance, dtype=float)
        if entries[0] > 0:
            place = first.pose.position
            covariance = (float(entries[0]), float(entries[1]), float(entries[7]))
    return LoggedDetection(place=(float(place.x), float(place.y)), covariance=covariance)
