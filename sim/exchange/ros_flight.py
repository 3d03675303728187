"""Flights in bags of ROS 2: poses and views of cameras, and detections, in the frames of REP 103 and 105."""

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.flight_doubts import Doubt, tell_doubts
from sim.exchange.ros_bag import CAMERA, IN_IMAGE, LABELS, ODOMETRY, ON_GROUND, TRANSFORMS, ReadTopic, read_topics
from sim.exchange.values import (
    POSE_GAP,
    CameraFrames,
    LoggedCamera,
    LoggedDetection,
    LoggedFrame,
    PoseLog,
    make_calibrated_camera,
    make_square_camera,
)
from sim.scenario.camera_settings import calibrate
from tracking.errors import InputError, spell
from tracking.numerics.arrays import Array

_OF_UAVS = (ODOMETRY, CAMERA, ON_GROUND, IN_IMAGE)
_STORAGES = (".mcap", ".db3")
_STILL = 0.1  # m, by which positions of a body that stands still differ at most
_NORM = 1e-2  # error of a quaternion's norm from which it is refused


class BagFlight(NamedTuple):
    """What a bag, or another source, has of a flight, by the number of the UAV."""

    cameras: dict[int, LoggedCamera]
    poses: dict[int, PoseLog]
    frames: dict[int, CameraFrames]
    remarks: list[str]
    epoch: float = math.nan  # s, time since 1970 of the zero of frames' times, if they are not since 1970
    longer: bool = False  # True if poses are of logs, which hold what was before and after the frames, too


class _Link(NamedTuple):
    """The frame of tf in which another one is, and its poses there, position [m] and quaternion xyzw, by time [s]."""

    parent: str
    topic: str
    kind: str  # type of the topic
    poses: dict[float, list[float]]


class _Trace(NamedTuple):
    """Poses of a camera in the last frame above its own one."""

    poses: PoseLog
    root: str  # name of that frame
    moving: Sequence[PoseLog]  # of the links that move
    spans: str  # from when to when each of these has poses


def find_bag(place: Path) -> Path | None:
    """A bag: a file, a folder, or the only one in a folder; None if there is none, InputError if there are several."""
    if place.suffix == ".bag" and place.is_file():
        raise InputError(f"FLIGHT: {place}: is a bag of ROS 1; rosbags-convert makes one of ROS 2 of it")
    if not place.is_dir():
        return place if place.is_file() and place.suffix in _STORAGES else None
    if (place / "metadata.yaml").exists():
        return place
    found = [path.parent for path in place.glob("*/metadata.yaml")]
    found = sorted(found or [path for path in place.iterdir() if path.suffix in _STORAGES])
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise InputError(f"FLIGHT: {place}: holds {len(found)} bags, {names}; expected one, or its own path as FLIGHT")
    return found[0] if found else None


def read_bag(path: Path, parts: Collection[str]) -> BagFlight:
    """Read parts of a flight, some of "cameras", "poses" and "detections", from a bag; InputError says what it lacks.

    Each UAV has a namespace, such as /uav0, or there is only one. It has an Odometry or transforms of tf up to the
    frame of its camera, a CameraInfo, and a Detection3DArray in the world's frame or a Detection2DArray. Times are
    those of headers. True odometry is left out if there is another one.
    """
    topics = read_topics(path, (*_OF_UAVS, TRANSFORMS, LABELS))
    if not any(topic.kind in _OF_UAVS for topic in topics.values()):
        raise InputError(f"bag: {path}: has no topics of UAVs; expected {', '.join(_OF_UAVS)}, as /uav0/odometry")
    flight = BagFlight({}, {}, {}, [])
    roots, doubts = set[str](), list[Doubt]()
    for i, (name, own) in enumerate(_split_by_uav(topics).items()):
        where = f"bag: {path}: {name}" if name else f"bag: {path}"
        kinds = {topic.kind for topic in own.values()}
        kind = ON_GROUND if ON_GROUND in kinds else IN_IMAGE
        messages = _choose(where, own, kind) if "detections" in parts else []
        classes = _name_classes(own)
        frames = sorted((_read_frame(message, classes, where) for message in messages), key=lambda frame: frame.time)
        seen_in = {_name_frame(message.header) for message in messages}
        infos = _choose(where, own, CAMERA, seen_in) if CAMERA in kinds or "cameras" in parts else []
        if "cameras" in parts:
            flight.cameras[i] = _read_camera(infos, where)
        if "poses" in parts:
            links, told = _link_frames(own, where)
            eye = _name_frame(infos[0].header) if infos else _find_optical(links, name, where)
            trace = _trace(links, eye, [frame.time for frame in frames], where)
            if kind == ON_GROUND and seen_in - {trace.root}:
                other = f"are in the frame {min(seen_in - {trace.root})!r}, but tf ends at {trace.root!r}"
                raise InputError(f"bag: {path}: detections of {name or 'the UAV'} {other}; expected them there")
            flight.poses[i] = trace.poses
            frames, left_out = _leave_out(frames, trace, where, i)
            flight.remarks.extend(told)
            doubts.extend(left_out)
            roots.add(trace.root)
        if "detections" in parts:
            flight.frames[i] = CameraFrames(frames, categories=classes)
    flight.remarks.extend(tell_doubts(doubts))
    if len(roots) > 1:
        raise InputError(f"bag: {path}: UAVs are in different frames of tf: {', '.join(sorted(roots))}")
    return flight


def _split_by_uav(topics: Mapping[str, ReadTopic]) -> dict[str, Mapping[str, ReadTopic]]:
    """The topics of each UAV by its namespace, with those of none, as /tf; all topics are those of a single UAV."""
    of_kind = {kind: {_name_uav(name) for name, topic in topics.items() if topic.kind == kind} for kind in _OF_UAVS}
    spaces = sorted(set().union(*of_kind.values()), key=_split_number)
    detected = of_kind[ON_GROUND] | of_kind[IN_IMAGE]
    if (max(len(of_kind[CAMERA]), len(detected)) or len(of_kind[ODOMETRY])) == 1:
        return {spaces[0] if len(spaces) == 1 else "": topics}
    found = dict[str, Mapping[str, ReadTopic]]()
    for space in spaces:
        others = {*spaces} - {space}
        found[space] = {name: topic for name, topic in topics.items() if _name_uav(name) not in others}
    return found


def _name_uav(topic: str) -> str:
    """The namespace of a topic: /uav0 of /uav0/camera/camera_info."""
    return "/" + topic.strip("/").split("/")[0]


def _name_frame(header: Any) -> str:  # noqa: ANN401 - messages have types of the bag's own
    return str(header.frame_id).lstrip("/")


def _split_number(name: str) -> list[tuple[int, str]]:
    """Key by which uav2 comes before uav10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


def _choose(where: str, own: Mapping[str, ReadTopic], kind: str, frames: Collection[str] = ()) -> list[Any]:
    """Messages of a UAV's only topic of a type; of several, of the only one that is not of tracks or of the truth.

    Of several cameras, it is the one in whose frame something is.
    """
    names = [name for name, topic in own.items() if topic.kind == kind]
    if len(names) > 1:
        names = [name for name in names if not re.search("true|truth|track|people", name)]
    if len(names) > 1 and frames:
        names = [name for name in names if _name_frame(own[name].messages[0].header) in frames]
    if len(names) != 1:
        several = f"has {len(names)} topics" if names else "has no topic"
        raise InputError(f"{where} {several} of {kind}; expected one, among {', '.join(sorted(own))}")
    return own[names[0]].messages


def _read_time(stamp: Any) -> float:  # noqa: ANN401 - messages have types of the bag's own
    """Time [s] of a header's stamp, rounded once."""
    return float((int(stamp.sec) * 10**9 + int(stamp.nanosec)) / 10**9)


def _link_frames(topics: Mapping[str, ReadTopic], where: str) -> tuple[dict[str, _Link], list[str]]:
    """The frames of tf, and those of odometry that tf does not have, by name; and what is said of odometry left out.

    True odometry counts least. Of a static transform the last message holds.
    """
    links: dict[str, _Link] = {}
    left_out: dict[str, str] = {}
    told = [name for name, topic in topics.items() if topic.kind in (TRANSFORMS, ODOMETRY)]
    for name in sorted(told, key=lambda name: (topics[name].kind == ODOMETRY, _is_true(name), name)):
        earlier = {*links} if topics[name].kind == ODOMETRY else {}
        for child, parent, time, pose in _list_poses(topics[name]):
            link = links.setdefault(child, _Link(parent, name, topics[name].kind, {}))
            if child in earlier:
                if link.kind == ODOMETRY and not _is_true(name):
                    left_out[name] = f"{where}: {link.topic} has poses of {child!r}; those of {name} are not used"
                continue
            if link.parent != parent:
                raise InputError(f"{where}: the frame {child!r} is in {link.parent!r} and in {parent!r}; expected one")
            if not abs(math.hypot(*pose[3:]) - 1) <= _NORM:
                norm = f"the norm of a quaternion of {child!r} is {spell(math.hypot(*pose[3:]), 3)}"
                raise InputError(f"{where}: {name}: {norm}; expected 1")
            if name.endswith("tf_static"):
                link.poses.clear()
            link.poses.setdefault(time, pose)
    return links, [*left_out.values()]


def _list_poses(topic: ReadTopic) -> Iterator[tuple[str, str, float, list[float]]]:
    """Frame, the one in which it is, time [s] and pose there of each transform or odometry."""
    for message in topic.messages:
        for link in message.transforms if topic.kind == TRANSFORMS else [message]:
            if topic.kind == TRANSFORMS:
                place, turn = link.transform.translation, link.transform.rotation
            else:
                place, turn = link.pose.pose.position, link.pose.pose.orientation
            pose = [float(value) for value in (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)]
            yield link.child_frame_id.lstrip("/"), _name_frame(link.header), _read_time(link.header.stamp), pose


def _is_true(topic: str) -> bool:
    """True if the name of a topic says that no tracker has it."""
    return re.search("true|truth", topic) is not None


def _find_optical(links: Mapping[str, _Link], name: str, where: str) -> str:
    """The only frame of tf that is called optical, and is of this UAV, if several are."""
    found = [frame for frame in links if "optical" in frame]
    found = found if len(found) < 2 else [frame for frame in found if frame.split("/")[0] == name.strip("/")]
    if len(found) != 1:
        there = ", ".join(map(repr, sorted(links))) or "none"
        lacks = "has no sensor_msgs/CameraInfo, whose header names the frame of the camera"
        raise InputError(
            f"{where}: {lacks}, nor one frame called optical; frames are {there}; poses.csv may give its poses"
        )
    return found[0]


def _trace(links: Mapping[str, _Link], frame: str, seen: Sequence[float], where: str) -> _Trace:
    """Poses of a camera at times at which each link above it has some; seen: times [s] of frames.

    They are at the times of the most frequent link that moves, and others are interpolated. If none moves, they are at
    the times of frames, as tf that stays what it is holds at all times.
    """
    name = frame
    chain = dict[str, PoseLog]()
    while name in links and name not in chain:
        times, rows = zip(*sorted(links[name].poses.items()), strict=True)
        chain[name] = PoseLog(np.array(times), np.array(rows))
        name = links[name].parent
    moving = {child: log for child, log in chain.items() if np.ptp(log.rows, axis=0).any()}
    for child, link in links.items() if not moving else ():
        if link.kind == ODOMETRY and child not in chain and (not chain or _flies(link)):
            apart = f"{link.topic} has poses of {child!r}, to which no tf links {name!r}, which is of the camera"
            raise InputError(f"{where}: {apart}; record /tf_static, too, or give poses of the camera in poses.csv")
    if not chain:
        raise InputError(f"{where}: has neither nav_msgs/Odometry nor tf of the frame {frame!r}, which is its camera's")
    spans = ", ".join(f"{child!r} in {links[child].parent!r} {_tell_span(log.times)}" for child, log in moving.items())
    instants = max((log.times for log in moving.values()), key=len, default=np.array(sorted({*seen}) or [0.0]))
    for log in moving.values():
        instants = instants[log.covers(instants) & (log.distances(instants) <= POSE_GAP)]
    if len(instants) == 0:
        raise InputError(f"{where}: poses are {spans}, never at one time; are all of one clock?")
    first, *above = chain.values()
    poses = first.at(instants)
    for log in above:
        frames = log.at(instants)
        turn = Rotation.from_quat(frames[:, 3:])
        attitude = (turn * Rotation.from_quat(poses[:, 3:])).as_quat()
        poses = np.hstack([frames[:, :3] + turn.apply(poses[:, :3]), attitude])
    return _Trace(PoseLog(instants, np.hstack([poses[:, :3], flip(poses[:, 3:])])), name, [*moving.values()], spans)


def _flies(link: _Link) -> bool:
    return bool(np.ptp([pose[:3] for pose in link.poses.values()], axis=0).max() > _STILL)


def _tell_span(times: Array) -> str:
    return f"from {spell(times[0])} to {spell(times[-1])} s"


def _leave_out(frames: list[LoggedFrame], trace: _Trace, where: str, uav: int) -> tuple[list[LoggedFrame], list[Doubt]]:
    """Frames at whose times there are poses, which tf does not extrapolate, and what is said of the others.

    InputError if one is far from all poses.
    """
    times = np.array([frame.time for frame in frames])
    for gaps in (log.distances(times) for log in trace.moving):
        if (gaps > POSE_GAP).any():
            far = f"has a frame at {spell(times[gaps.argmax()])} s, but no pose within {POSE_GAP:g} s"
            raise InputError(f"{where}: {far}; poses are {trace.spans}; are all of one clock?")
    kept = [frame for frame, there in zip(frames, trace.poses.covers(times), strict=True) if there]
    lost = len(frames) - len(kept)
    told = f"{where}: left out: {lost} frame{'s' * (lost > 1)} before or after poses, which are {trace.spans}"
    return kept, [Doubt(uav, told, "")] * (lost > 0)


def flip(quaternions: Array) -> Array:
    """Attitudes (N, 4) xyzw after half a turn about their x axes.

    The turn is that from the axes of `Pose` to a camera's optical ones, y down and z ahead, or back.
    """
    return np.asarray(quaternions[:, ::-1] * (1.0, 1.0, -1.0, -1.0) + 0.0)  # without the sign of zeros


def _read_camera(infos: Sequence[Any], where: str) -> LoggedCamera:
    """The camera of a topic of CameraInfo, which is the same in all messages; InputError if it is none."""
    first = infos[0]
    for info in infos:
        if _list_numbers(info) != _list_numbers(first):
            at = spell(_read_time(info.header.stamp))
            raise InputError(f"{where}: its CameraInfo changes at {at} s; expected one camera in a flight")
    region = [int(getattr(first.roi, name)) for name in ("x_offset", "y_offset", "width", "height")]
    k, bend = (np.asarray(part, dtype=float).tolist() for part in (first.k, first.d))
    binning = (int(first.binning_x), int(first.binning_y))
    try:
        settings = calibrate((int(first.width), int(first.height)), k, bend, first.distortion_model, region, binning)
    except ValueError as error:
        raise InputError(f"{where}: its CameraInfo: {error}") from error
    width, (fx, fy), (cx, cy) = settings.width, settings.focal or (0.0, 0.0), settings.centre or (0.0, 0.0)
    centred = math.isclose(cx + 0.5, width / 2) and cx == cy
    straight = not any(bend) and settings.distortion_model == "plumb_bob"
    if width == settings.height and fx == fy and centred and straight:
        return make_square_camera(math.degrees(2 * math.atan(width / 2 / fx)), width)
    return make_calibrated_camera(settings)


def _list_numbers(info: Any) -> list[float]:  # noqa: ANN401 - as above
    """All numbers of a CameraInfo that describe its camera."""
    region = (info.roi.x_offset, info.roi.y_offset, info.roi.width, info.roi.height)
    return [info.width, info.height, info.binning_x, info.binning_y, *region, *info.k, *info.d]


def _name_classes(own: Mapping[str, ReadTopic]) -> dict[str, str]:
    """Names of classes by their numbers, from messages of LabelInfo."""
    told = (message for topic in own.values() if topic.kind == LABELS for message in topic.messages)
    return {str(one.class_id): str(one.class_name) for message in told for one in message.class_map}


def _read_frame(message: Any, classes: Mapping[str, str], where: str) -> LoggedFrame:  # noqa: ANN401 - as above
    time = _read_time(message.header.stamp)
    found = [_read_detection(found, classes) for found in message.detections]
    return LoggedFrame(time, f"{where}, {time:.3f} s", found)


def _read_detection(found: Any, classes: Mapping[str, str]) -> LoggedDetection:  # noqa: ANN401 - as above
    """A detection in the image, or on the ground with the covariance of its likeliest result, if that has one.

    A box without a size is nowhere.
    """
    likeliest = max(found.results, key=_read_score, default=None)
    category, score = ("", math.nan) if likeliest is None else (_read_class(likeliest), _read_score(likeliest))
    detection = LoggedDetection(category=classes.get(category, category), score=score)
    centre = found.bbox.center
    if not hasattr(found.bbox, "size"):  # of a Detection2D; older ones have x and y in the centre itself
        place = getattr(centre, "position", centre)
        sized = found.bbox.size_x >= 0 and found.bbox.size_y >= 0
        return detection._replace(pixel=(float(place.x), float(place.y))) if sized else detection
    place = centre.position
    covariance = (math.nan, math.nan, math.nan)
    if likeliest is not None:
        entries = np.asarray(likeliest.pose.covariance, dtype=float)
        if entries[0] > 0:
            place = likeliest.pose.pose.position
            covariance = (float(entries[0]), float(entries[1]), float(entries[7]))
    return detection._replace(place=(float(place.x), float(place.y)), covariance=covariance)


def _read_class(result: Any) -> str:  # noqa: ANN401 - as above
    """The class of a result of vision_msgs, whose older releases have `id`, also as a number, in the result itself."""
    found = getattr(result, "hypothesis", result)
    return str(getattr(found, "class_id", getattr(found, "id", "")))


def _read_score(result: Any) -> float:  # noqa: ANN401 - as above
    return float(getattr(result, "hypothesis", result).score)
