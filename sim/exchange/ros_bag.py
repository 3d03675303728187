"""A bag of ROS 2 that is being written, with MCAP as its storage and standard types of messages; needs no ROS."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tracking.errors import InputError

Message = dict[str, Any] | Sequence[Any]  # a message's fields by name, where others are zero, or all in order
# Definitions of vision_msgs 4, which the library does not have.
_VISION = {
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


class _Field(NamedTuple):
    """A field of a type of messages."""

    place: int
    kind: str  # type of the messages in it; empty if it has plain values
    several: bool


class _Form(NamedTuple):
    """A type of messages, its fields by name, and the values of a message of zeros."""

    make: Any
    fields: dict[str, _Field]
    zeros: list[Any]


class RosBag:
    """A bag that is being written into a new folder; messages have to come in order of time."""

    def __init__(self, folder: Path) -> None:
        try:
            from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore
        except ImportError as error:
            raise InputError("--to: rosbag needs rosbags: pip install 'rosbags>=0.11'") from error
        self._store: Any = get_typestore(Stores.ROS2_HUMBLE)
        for name, text in _VISION.items():
            self._store.register(get_types_from_msg(text, f"vision_msgs/msg/{name}"))
        self._writer: Any = Writer(folder, version=8, storage_plugin=StoragePlugin.MCAP)  # which Humble reads, too
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._topics = dict[str, Any]()
        self._forms = dict[str, _Form]()

    def __enter__(self) -> "RosBag":
        self._writer.open()
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.__exit__(*error)

    def write(self, topic: str, kind: str, time: float, message: Message, *, latched: bool = False) -> None:
        """Write a message at a time [s]; who subscribes late to a latched topic gets its last message.

        kind: as `std_msgs/msg/Float64`.
        """
        if topic not in self._topics:
            offered = _offer_latched() if latched else []
            connect = self._writer.add_connection
            self._topics[topic] = connect(topic, kind, typestore=self._store, offered_qos_profiles=offered)
        content = self._store.serialize_cdr(self._build(kind, message), kind)
        self._writer.write(self._topics[topic], round(time * 1e9), content)

    def _build(self, kind: str, message: Message) -> Any:  # noqa: ANN401 - types are made as the program runs
        form = self._forms.get(kind) or self._find_form(kind)
        values = form.zeros.copy()
        for name, value in message.items() if isinstance(message, dict) else zip(form.fields, message, strict=True):
            place, inner, several = form.fields[name]
            if not inner:
                values[place] = value
            else:
                values[place] = [self._build(inner, one) for one in value] if several else self._build(inner, value)
        return form.make(*values)

    def _find_form(self, kind: str) -> _Form:
        from rosbags.interfaces import Nodetype

        form = self._forms[kind] = _Form(self._store.types[kind], {}, [])
        for place, (name, (node, what)) in enumerate(self._store.fielddefs[kind][1]):
            several = node in (Nodetype.ARRAY, Nodetype.SEQUENCE)
            (inner, of), count = what if several else ((node, what), 0)
            if inner == Nodetype.NAME:
                form.zeros.append([] if several else self._build(of, {}))
            else:
                form.zeros.append(np.zeros(count, of[0]) if several else {"string": "", "bool": False}.get(of[0], 0))
            form.fields[name] = _Field(place, of if inner == Nodetype.NAME else "", several)
        return form


def _offer_latched() -> list[Any]:
    """The quality of service of a topic whose last message is kept for those who subscribe later."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    unset = QosTime(0, 0)
    kept = QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL
    return [Qos(QosHistory.KEEP_LAST, 1, *kept, unset, unset, QosLiveliness.AUTOMATIC, unset, False)]
