"""Bags of ROS 2: poses and views of cameras, and detections, by standard messages and the frames of REP 103 and 105."""

import math
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.flight_tables import CameraRow, Detection, Fleet, LoggedFrame, Poses
from sim.scenario.camera_settings import calibrate
from tracking.errors import InputError, one_line
from tracking.geometry.quaternions import interpolate_poses

ODOMETRY = "nav_msgs/msg/Odometry"
CAMERA = "sensor_msgs/msg/CameraInfo"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
ON_GROUND, IN_IMAGE = "vision_msgs/msg/Detection3DArray", "vision_msgs/msg/Detection2DArray"
_OF_UAVS = (ODOMETRY, CAMERA, ON_GROUND, IN_IMAGE)
OPTICAL = np.array([1.0, 0.0, 0.0, 0.0])  # turn from the axes of `Pose` to a camera's optical ones: y down, z ahead


class BagFlight(NamedTuple):
    """The content of a bag: a flight."""

    poses: dict[int, Poses]
    cameras: dict[int, CameraRow]
    fleet: Fleet


class _Link(NamedTuple):
    """A frame of tf in its parent."""

    parent: str
    poses: Poses


def find_bag(folder: Path) -> Path | None:
    """The bag in a folder or in one of its own folders; None if there is none."""
    return next(
        (path.parent for path in sorted([*folder.glob("metadata.yaml"), *folder.glob("*/metadata.yaml")])), None
    )


def read_bag(path: Path) -> BagFlight:
    """Read a bag with a namespace for each UAV, such as /uav0; InputError says what it lacks.

    Each has an Odometry or transforms of tf up to the frame of its camera, a CameraInfo, and a Detection3DArray in the
    world's frame or a Detection2DArray. Times come from headers. True odometry is left out if there is another one.
    """
    topics = _read_topics(path)
    names = sorted({_name_uav(topic) for topic, (kind, _) in topics.items() if kind in _OF_UAVS}, key=_split_number)
    if not names:
        raise InputError(f"bag: {path}: has no topics of UAVs; expected {', '.join(_OF_UAVS)}, as /uav0/odometry")
    links = _link_frames(topics)
    poses, cameras, fleet, roots = dict[int, Poses](), dict[int, CameraRow](), Fleet(), dict[str, str]()
    for i, name in enumerate(names):
        own = {topic: found for topic, found in topics.items() if _name_uav(topic) == name}
        info = _choose(path, name, own, CAMERA)[0]
        cameras[i] = _read_camera(info, f"bag: {path}: {name}")
        poses[i], roots[name] = _trace(links, info.header.frame_id, f"bag: {path}: {name}")
        kind = ON_GROUND if any(found[0] == ON_GROUND for found in own.values()) else IN_IMAGE
        messages = _choose(path, name, own, kind)
        frames = {message.header.frame_id for message in messages}
        if kind == ON_GROUND and frames - {roots[name]}:
            other = f"detections of {name} are in the frame {min(frames)!r}, but tf ends at {roots[name]!r}"
            raise InputError(f"bag: {path}: {other}; expected them there")
        fleet[i] = [_read_frame(message, f"bag: {path}: {name}") for message in messages]
    if len({*roots.values()}) > 1:
        raise InputError(f"bag: {path}: UAVs are in different frames of tf: {', '.join(sorted({*roots.values()}))}")
    return BagFlight(poses, cameras, fleet)


def _read_topics(path: Path) -> dict[str, tuple[str, list[Any]]]:
    """Type and messages of each topic of a known type."""
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError(f"bag: {path}: needs rosbags: pip install 'rosbags>=0.11'") from error
    found: dict[str, tuple[str, list[Any]]] = {}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            known = [c for c in reader.connections if c.msgtype in (*_OF_UAVS, TRANSFORMS)]
            for connection, _, raw in reader.messages(known):
                message = reader.deserialize(raw, connection.msgtype)
                found.setdefault(connection.topic, (connection.msgtype, []))[1].append(message)
    except (AnyReaderError, OSError, ValueError, KeyError) as error:
        raise InputError(f"bag: {path}: cannot be read: {one_line(error)}") from error
    return found


def _name_uav(topic: str) -> str:
    """The namespace of a topic: /uav0 of /uav0/camera/camera_info."""
    return "/" + topic.strip("/").split("/")[0]


def _split_number(name: str) -> list[tuple[int, str]]:
    """Sort key that puts uav2 before uav10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


def _choose(path: Path, name: str, own: dict[str, tuple[str, list[Any]]], kind: str) -> list[Any]:
    """Messages of a UAV's only topic of a type; of several, of the only one that is not of tracks or of the truth."""
    topics = [topic for topic, (found, _) in own.items() if found == kind]
    if len(topics) > 1:
        topics = [topic for topic in topics if not re.search("true|truth|track|people", topic)]
    if len(topics) != 1:
        several = f"has {len(topics)} topics" if topics else "has no topic"
        raise InputError(f"bag: {path}: {name} {several} of {kind}; expected one, among {', '.join(sorted(own))}")
    return own[topics[0]][1]


def _read_time(stamp: Any) -> float:  # noqa: ANN401 - messages have types of the bag's own
    """Time [s] of a header's stamp, rounded once."""
    return float((int(stamp.sec) * 10**9 + int(stamp.nanosec)) / 10**9)


def _link_frames(topics: dict[str, tuple[str, list[Any]]]) -> dict[str, _Link]:
    """The frames of tf, and those of odometry that tf does not have, by name."""
    rows: defaultdict[str, dict[float, list[float]]] = defaultdict(dict)
    parents: dict[str, str] = {}
    for child, parent, time, row in [*_list_transforms(topics), *_list_odometry(topics)]:
        if parents.setdefault(child, parent) == parent:
            rows[child].setdefault(time, row)
    links = dict[str, _Link]()
    for child, found in rows.items():
        times, poses = zip(*sorted(found.items()), strict=True)
        links[child] = _Link(parents[child], Poses(np.array(times), np.array(poses)))
    return links


def _list_transforms(topics: dict[str, tuple[str, list[Any]]]) -> Iterator[tuple[str, str, float, list[float]]]:
    """Child, parent, time and pose of each transform."""
    for kind, messages in topics.values():
        for message in messages if kind == TRANSFORMS else ():
            for link in message.transforms:
                row = _make_row(link.transform.translation, link.transform.rotation)
                yield *_name_frames(link), _read_time(link.header.stamp), row


def _list_odometry(topics: dict[str, tuple[str, list[Any]]]) -> Iterator[tuple[str, str, float, list[float]]]:
    """Child, parent, time and pose of each odometry, that of the truth last."""
    for topic in sorted(topics, key=lambda topic: ("true" in topic or "truth" in topic, topic)):
        kind, messages = topics[topic]
        for message in messages if kind == ODOMETRY else ():
            row = _make_row(message.pose.pose.position, message.pose.pose.orientation)
            yield *_name_frames(message), _read_time(message.header.stamp), row


def _name_frames(message: Any) -> tuple[str, str]:  # noqa: ANN401 - messages have types of the bag's own
    """The frame of a transform or an odometry, and its parent."""
    return message.child_frame_id.lstrip("/"), message.header.frame_id.lstrip("/")


def _make_row(place: Any, turn: Any) -> list[float]:  # noqa: ANN401 - messages have types of the bag's own
    return [float(value) for value in (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)]


def _trace(links: dict[str, _Link], frame: str, where: str) -> tuple[Poses, str]:
    """Poses of a camera in the last frame above its own one, and the name of that frame.

    They are at the times of the frame's most frequent link; others are interpolated.
    """
    name, chain = frame.lstrip("/"), list[_Link]()
    while name in links and len(chain) < len(links):
        chain.append(links[name])
        name = chain[-1].parent
    if not chain:
        raise InputError(f"{where}: has neither nav_msgs/Odometry nor tf of the frame {frame!r}, which is its camera's")
    times = max((link.poses.times for link in chain), key=len)
    position = np.zeros((len(times), 3))
    attitude = Rotation.from_quat(np.tile(OPTICAL, (len(times), 1)))
    for link in chain:
        row = interpolate_poses(link.poses.times, link.poses.rows, np.clip(times, *link.poses.times[[0, -1]]))
        turn = Rotation.from_quat(row[:, 3:])
        position, attitude = row[:, :3] + turn.apply(position), turn * attitude
    return Poses(times, np.hstack([position, attitude.as_quat()])), name


def _read_camera(info: Any, where: str) -> CameraRow:  # noqa: ANN401 - messages have types of the bag's own
    """The camera of a CameraInfo; InputError if it is none."""
    k, bend = (np.asarray(values, dtype=float).tolist() for values in (info.k, info.d))
    try:
        settings = calibrate((int(info.width), int(info.height)), k, bend, info.distortion_model)
    except ValueError as error:
        raise InputError(f"{where}: its CameraInfo: {error}") from error
    (width, height), (fx, fy), middle = (settings.width, settings.height), settings.focal or (0.0, 0.0), k[2] + 0.5
    if width == height and fx == fy and not any(bend) and math.isclose(middle, width / 2) and k[2] == k[5]:
        return CameraRow.square(math.degrees(2 * math.atan(width / 2 / fx)), width)
    return CameraRow.calibrated(settings)


def _read_frame(message: Any, where: str) -> LoggedFrame:  # noqa: ANN401 - messages have types of the bag's own
    time = _read_time(message.header.stamp)
    return LoggedFrame(time, f"{where}, {time:.3f} s", [_read_detection(found) for found in message.detections])


def _read_detection(found: Any) -> Detection:  # noqa: ANN401 - messages have types of the bag's own
    """A detection in the image, or on the ground with the covariance of its first result, if that has one."""
    centre = found.bbox.center
    if not hasattr(found.bbox, "size"):  # of a Detection2D; older ones have x and y in the centre itself
        place = getattr(centre, "position", centre)
        return Detection(pixel=(float(place.x), float(place.y)))
    place, covariance = centre.position, (math.nan, math.nan, math.nan)
    if len(found.results):
        first = found.results[0].pose
        entries = np.asarray(first.covariance, dtype=float)
        if entries[0] > 0:
            place, covariance = first.pose.position, (float(entries[0]), float(entries[1]), float(entries[7]))
    return Detection(place=(float(place.x), float(place.y)), covariance=covariance)
