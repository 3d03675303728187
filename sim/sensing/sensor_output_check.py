"""Detection check: validates the output of plug-in detectors and sensor modes for trackers and recordings."""

from dataclasses import replace
from typing import get_args

import numpy as np

from sim.sensing.fault import Fault
from sim.sensing.sensor_mode import Noise, SensorOutput
from tracking.detection.detector import Detections, Frame
from tracking.errors import spell
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.plugins.array_checks import check_array, check_numbers, check_positive_definite, check_whole_numbers
from tracking.plugins.plugin_error import Unusable

_SHAPES = {"pixels": (2,), "ground": (2,), "covariances": (2, 2)}  # of one detection
_UNITS = {"pixels": "pixels", "ground": "m"}
_FARTHEST = 1e6  # m or pixels; larger coordinates are meaningless
_MOST = 200  # detections of a plug-in in one frame; more would take trackers seconds


def check_detections(found: Detections) -> Detections:
    """Detections as arrays of floats that trackers can use; `Unusable` says why they cannot be used."""
    if not all(hasattr(found, name) for name in _SHAPES):
        raise Unusable(f"it is not Detections but of type {type(found).__name__}")
    arrays = {name: check_numbers(name, getattr(found, name)) for name in _SHAPES}
    if not any(array.size for array in arrays.values()):
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    count = len(arrays["ground"]) if arrays["ground"].ndim else 0
    if count > _MOST:
        raise Unusable(f"{count} detections are more than {_MOST}")
    return Detections(**{name: _check_output(name, array, count) for name, array in arrays.items()})


def check_output(output: SensorOutput, people: Array) -> SensorOutput:
    """Valid output of a sensor mode, given people (M, 2) m, NaN if absent; `Unusable` says what is wrong."""
    _check_kind("output", output, SensorOutput)
    count, faults = len(output.ground), tuple(output.faults)
    for fault in faults:
        _check_kind("faults", fault, Fault)
    if output.frame is not None:
        _check_frame(output.frame)
    if output.noise not in get_args(Noise):
        raise Unusable(f"noise {output.noise!r} is unknown; allowed are {' and '.join(get_args(Noise))}")
    if output.noise == "none" and output.covariances is None:
        raise Unusable("noise is 'none', but there are no covariances")
    return replace(
        output,
        ground=_check_output("ground", output.ground, count),
        owners=_check_owners(output.owners, people, count),
        visible=_check_visible(output.visible, people),
        covariances=None if output.covariances is None else _check_output("covariances", output.covariances, count),
        pixels=None if output.pixels is None else _check_output("pixels", output.pixels, count),
        faults=faults,
    )


def _check_output(name: str, given: object, count: int) -> Array:
    """Valid pixels, ground points or covariances of `count` detections."""
    array = check_array(name, given, (count, *_SHAPES[name]))
    if name not in _UNITS:
        check_positive_definite(name, array, " m²")
    elif np.abs(array).max(initial=0.0) > _FARTHEST:
        raise Unusable(f"{name} more than {spell(_FARTHEST)} {_UNITS[name]} away")
    return array


def _check_owners(given: object, people: Array, count: int) -> Indices:
    """Index (N,) of the person of each of `count` detections, -1 for none."""
    owners = check_whole_numbers("owners", given, (count,))
    if owners.min(initial=0) < -1 or owners.max(initial=-1) >= len(people):
        raise Unusable(f"owners are not from -1 to {len(people) - 1}")
    _check_present("owners", np.isin(np.arange(len(people)), owners), people)
    return owners


def _check_visible(given: object, people: Array) -> Indices:
    """Number (M,) of pixels that show each person; True and False count as 1 and 0."""
    visible = check_whole_numbers("visible", given, (len(people),), "biu")
    if visible.min(initial=0) < 0:
        raise Unusable("visible are below 0")
    _check_present("visible", visible > 0, people)
    return visible


def _check_present(name: str, found: Flags, people: Array) -> None:
    if np.any(found & np.isnan(people[:, 0])):
        raise Unusable(f"{name} include absent people")


def _check_frame(frame: Frame) -> None:
    _check_kind("frame", frame, Frame)
    image = np.asarray(frame.image)
    if image.shape != (*image.shape[:2], 3) or image.dtype != np.uint8:
        raise Unusable(f"frame's image of shape {image.shape} and type {image.dtype}, not (H, W, 3) and uint8")


def _check_kind(name: str, given: object, kind: type) -> None:
    if not isinstance(given, kind):
        raise Unusable(f"{name}: {type(given).__name__} is no {kind.__module__}.{kind.__qualname__}")
