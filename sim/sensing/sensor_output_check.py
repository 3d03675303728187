"""Detection check: validates the output of plug-in detectors and sensor modes for trackers and recordings."""

from dataclasses import replace
from typing import get_args

import numpy as np

from sim.sensing.sensor_mode import Noise, SensorOutput
from tracking.detection.detector import Detections, Frame
from tracking.numerics.arrays import Array, Flags
from tracking.plugins.plugin_error import Unusable
from tracking.plugins.result_check import WHOLE, Form, check_fields, check_kind, read_numbers

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
    """Valid output of a sensor mode, given people (M, 2) m, NaN if absent; `Unusable` says what is wrong."""
    check_kind("output", output, SensorOutput)
    count = len(output.ground)
    if output.frame is not None:
        _check_frame(output.frame)
    if output.noise not in get_args(Noise):
        raise Unusable(f"noise {output.noise!r} is unknown; allowed are {' and '.join(get_args(Noise))}")
    if output.noise == "none" and output.covariances is None:
        raise Unusable("noise is 'none', but there are no covariances")
    owners = WHOLE.check("owners", output.owners, count)
    if owners.min(initial=0) < -1 or owners.max(initial=-1) >= len(people):
        raise Unusable(f"owners are not from -1 to {len(people) - 1}")
    _check_present("owners", np.isin(np.arange(len(people)), owners), people)
    visible = Form(whole="biu").check("visible", output.visible, len(people))  # True and False count as 1 and 0
    if visible.min(initial=0) < 0:
        raise Unusable("visible are below 0")
    _check_present("visible", visible > 0, people)
    given = {name: form for name, form in _DETECTION.items() if getattr(output, name) is not None}
    arrays = check_fields(output, given, count)
    return replace(output, owners=owners, visible=visible, **arrays)


def _check_present(name: str, found: Flags, people: Array) -> None:
    if np.any(found & np.isnan(people[:, 0])):
        raise Unusable(f"{name} include absent people")


def _check_frame(frame: Frame) -> None:
    check_kind("frame", frame, Frame)
    image = np.asarray(frame.image)
    if image.shape != (*image.shape[:2], 3) or image.dtype != np.uint8:
        raise Unusable(f"frame's image of shape {image.shape} and type {image.dtype}, not (H, W, 3) and uint8")
