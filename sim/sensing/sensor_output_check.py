"""Detection check: validates the output of plug-in detectors and sensor modes for trackers and recordings."""

from dataclasses import replace

import numpy as np

from sim.sensing.fault import Fault
from sim.sensing.sensor_mode import SensorOutput
from tracking.detection.detector import Detections, Frame
from tracking.numerics.arrays import Array, Flags
from tracking.plugins.plugin_error import Unusable
from tracking.plugins.result_check import Form, check_fields, check_kind, read_numbers

_FARTHEST = 1e6  # m or pixels; larger coordinates are meaningless
_DETECTION = {
    "pixels": Form((2,), farthest=_FARTHEST, unit="pixels"),
    "ground": Form((2,), farthest=_FARTHEST, unit="m"),
    "covariances": Form((2, 2), definite=True, unit="m²"),
}
_MOST = 200  # detections of a plug-in in one frame; more would take trackers seconds


def check_detections(found: Detections) -> Detections:
    """Detections as arrays of floats that trackers can use; `Unusable` says why they cannot be used."""
    if not all(hasattr(found, name) for name in _DETECTION):
        raise Unusable(f"it is not Detections but of type {type(found).__name__}")
    arrays = {name: read_numbers(name, getattr(found, name)) for name in _DETECTION}
    if not any(array.size for array in arrays.values()):
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    count = len(arrays["ground"]) if arrays["ground"].ndim else 0
    if count > _MOST:
        raise Unusable(f"{count} detections are more than {_MOST}")
    return Detections(**check_fields(found, _DETECTION, count))


def check_output(output: SensorOutput, people: Array) -> SensorOutput:
    """Valid output of a sensor mode, given people (M, 2) m, NaN if absent; `Unusable` says what is wrong.

    Values that `matched` returns are checked by `check_matches`.
    """
    check_kind("output", output, SensorOutput)
    faults = tuple(output.faults)
    for fault in faults:
        check_kind("faults", fault, Fault)
    if output.frame is not None:
        _check_frame(output.frame)
    visible = Form(whole="biu").check("visible", output.visible, len(people))  # True and False count as 1 and 0
    if visible.min(initial=0) < 0:
        raise Unusable("visible are below 0")
    _check_present("visible", visible > 0, people)
    given = [name for name in _DETECTION if getattr(output, name) is not None]
    arrays = check_fields(output, {name: _DETECTION[name] for name in given}, len(output.ground))
    if output.errors is not None:
        arrays["errors"] = _DETECTION["covariances"].check("errors", output.errors, len(output.ground))
    return replace(output, visible=visible, faults=faults, **arrays)


def check_matches(matched: object, people: Array) -> Flags:
    """Valid mask (M,) of detected people, given people (M, 2) m, NaN if absent; `Unusable` says what is wrong."""
    found = np.array(matched)
    if found.shape != (len(people),) or found.dtype != np.bool_:
        raise Unusable(f"matched is not an array ({len(people)},) of True and False")
    _check_present("matched", found, people)
    return found


def _check_present(name: str, found: Flags, people: Array) -> None:
    if np.any(found & np.isnan(people[:, 0])):
        raise Unusable(f"{name} include absent people")


def _check_frame(frame: Frame) -> None:
    check_kind("frame", frame, Frame)
    image = np.asarray(frame.image)
    if image.shape != (*image.shape[:2], 3) or image.dtype != np.uint8:
        raise Unusable(f"frame's image of shape {image.shape} and type {image.dtype}, not (H, W, 3) and uint8")
