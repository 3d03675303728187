"""Bags of ROS 2: names of topics and of standard types, and files that are read and written without ROS."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tracking.errors import InputError, one_line

CAMERA = "sensor_msgs/msg/CameraInfo"
IMAGE = "sensor_msgs/msg/CompressedImage"
IN_IMAGE = "vision_msgs/msg/Detection2DArray"
LABELS = "vision_msgs/msg/LabelInfo"
LOG = "rcl_interfaces/msg/Log"
MARKERS = "visualization_msgs/msg/MarkerArray"
NUMBER = "std_msgs/msg/Float64"
ODOMETRY = "nav_msgs/msg/Odometry"
ON_GROUND = "vision_msgs/msg/Detection3DArray"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
VELOCITY = "geometry_msgs/msg/TwistStamped"
# Definitions of vision_msgs 4, which the library does not have.
_VISION = {
    "VisionClass": "uint16 class_id\nstring class_name\n",
    "LabelInfo": "std_msgs/Header header\nvision_msgs/VisionClass[] class_map\nfloat32 threshold\n",
    "Point2D": "float64 x\nfloat64 y\n",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "ObjectHypothesis": "string class_id\nfloat64 score\n",
    "ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n",
}
for _size in ("2D", "3D"):
    _detection = "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    _VISION[f"Detection{_size}"] = f"{_detection}vision_msgs/BoundingBox{_size} bbox\nstring id\n"
    _VISION[f"Detection{_size}Array"] = f"std_msgs/Header header\nvision_msgs/Detection{_size}[] detections\n"
START = 1  # s, stamp of a mission's start, as ROS takes a stamp of 0 for none

RosMessage = dict[str, Any] | Sequence[Any]  # fields by name, where others are zero, or all in order


class Topic(NamedTuple):
    """A topic; who subscribes late to a latched one gets its last message."""

    name: str  # `{}` stands for the number of a UAV
    kind: str  # type of its messages
    latched: bool = False


# The topics of a mission's bag, which docs/how-to/tracking.md describes.
FOREST = Topic("/forest", MARKERS, latched=True)
PEOPLE = Topic("/people", MARKERS)
FRAMES = Topic("/tf", TRANSFORMS)
EVENTS = Topic("/events", LOG)
FLEET_ERRORS = {name: Topic(f"/{name}", NUMBER) for name in ("ospa", "gospa")}
ERRORS = {name: Topic(f"/uav{{}}/{name}", NUMBER) for name in FLEET_ERRORS}
BYTES_SENT = Topic("/uav{}/bytes_sent", NUMBER)
BODY = Topic("/uav{}/odometry", ODOMETRY)
TRUE_BODY = Topic("/uav{}/odometry_true", ODOMETRY)
COMMAND = Topic("/uav{}/command", VELOCITY)
CAMERA_INFO = Topic("/uav{}/camera/camera_info", CAMERA, latched=True)
IMAGES = Topic("/uav{}/camera/image/compressed", IMAGE)
IMAGE_DETECTIONS = Topic("/uav{}/camera/detections", IN_IMAGE)
DETECTIONS = Topic("/uav{}/detections", ON_GROUND)
TRACKS = Topic("/uav{}/tracks", ON_GROUND)
UAV_MARKERS = Topic("/uav{}/markers", MARKERS)
MAP = Topic("/uav{}/forest", MARKERS, latched=True)


def count_nanoseconds(time: float) -> int:
    """The stamp [ns] of a mission's time [s]."""
    return START * 10**9 + round(time * 1e9)


def _make_store() -> Any:  # noqa: ANN401 - the library has no public type for it
    """The types of messages of Humble, with those of vision_msgs."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _VISION.items():
        store.register(get_types_from_msg(text, f"vision_msgs/msg/{name}"))
    return store


class ReadTopic(NamedTuple):
    """The messages of a topic in a bag."""

    kind: str
    messages: list[Any]


def read_topics(path: Path, kinds: Collection[str]) -> dict[str, ReadTopic]:
    """The topics of these types in a bag, by name; InputError if it cannot be read."""
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
    except ImportError as error:
        raise InputError(f"bag: {path}: needs rosbags: pip install 'rosbags>=0.11'") from error
    found: dict[str, ReadTopic] = {}
    try:
        with AnyReader([path], default_typestore=_make_store()) as reader:
            known = [connection for connection in reader.connections if connection.msgtype in kinds]
            for connection, _, raw in reader.messages(known):
                topic = found.setdefault(connection.topic, ReadTopic(connection.msgtype, []))
                topic.messages.append(reader.deserialize(raw, connection.msgtype))
    except (AnyReaderError, OSError, ValueError, KeyError) as error:
        raise InputError(f"bag: {path}: cannot be read: {one_line(error)}") from error
    return found


class _Part(NamedTuple):
    """A field of a type of messages."""

    place: int
    kind: str  # type of the messages in it; empty if it has plain values
    several: bool


class _MessageType(NamedTuple):
    """A type of messages, its fields by name, and the values of a message of zeros."""

    make: Any
    parts: dict[str, _Part]
    zeros: list[Any]


class RosBag:
    """A bag that is being written into a new folder, with MCAP as its storage; messages come in order of time."""

    def __init__(self, folder: Path) -> None:
        try:
            from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
        except ImportError as error:
            raise InputError("--to: rosbag needs rosbags: pip install 'rosbags>=0.11'") from error
        self._store: Any = _make_store()
        self._writer: Any = Writer(folder, version=8, storage_plugin=StoragePlugin.MCAP)  # which Humble reads, too
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._connections = dict[str, Any]()
        self._types = dict[str, _MessageType]()

    def __enter__(self) -> "RosBag":
        self._writer.open()
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.__exit__(*error)

    def write(self, topic: Topic, time: float, message: RosMessage, uav: int | None = None) -> None:
        """Write a message at a time [s] of the mission; uav: the number in the topic's name, if it has one."""
        name = topic.name.format(uav)
        if name not in self._connections:
            offered = _offer_latched() if topic.latched else []
            connect = self._writer.add_connection
            self._connections[name] = connect(name, topic.kind, typestore=self._store, offered_qos_profiles=offered)
        content = self._store.serialize_cdr(self._build(topic.kind, message), topic.kind)
        self._writer.write(self._connections[name], count_nanoseconds(time), content)

    def _build(self, kind: str, message: RosMessage) -> Any:  # noqa: ANN401 - types are made as the program runs
        known = self._types.get(kind) or self._find_type(kind)
        values = known.zeros.copy()
        for name, value in message.items() if isinstance(message, dict) else zip(known.parts, message, strict=True):
            place, inner, several = known.parts[name]
            if not inner:
                values[place] = value
            else:
                values[place] = [self._build(inner, one) for one in value] if several else self._build(inner, value)
        return known.make(*values)

    def _find_type(self, kind: str) -> _MessageType:
        from rosbags.interfaces import Nodetype

        found = self._types[kind] = _MessageType(self._store.types[kind], {}, [])
        for place, (name, (node, what)) in enumerate(self._store.fielddefs[kind][1]):
            several = node in (Nodetype.ARRAY, Nodetype.SEQUENCE)
            (inner, of), count = what if several else ((node, what), 0)
            if inner == Nodetype.NAME:
                found.zeros.append([] if several else self._build(of, {}))
            else:
                found.zeros.append(np.zeros(count, of[0]) if several else {"string": "", "bool": False}.get(of[0], 0))
            found.parts[name] = _Part(place, of if inner == Nodetype.NAME else "", several)
        return found


def _offer_latched() -> list[Any]:
    """The quality of service of a topic whose last message is kept for those who subscribe later."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    unset = QosTime(0, 0)
    kept = QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL
    return [Qos(QosHistory.KEEP_LAST, 1, *kept, unset, unset, QosLiveliness.AUTOMATIC, unset, False)]
