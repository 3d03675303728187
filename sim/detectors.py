"""Detectors by name, or by import string."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sim.errors import InputError
from sim.loading import did_you_mean
from tracking.plugin import imported

if TYPE_CHECKING:  # checking a name needs none of their code
    from sim.segmentation import MaskDetector
    from tracking.detector import Detector
    from tracking.visibility import Forest

DETECTORS = {
    "blob": "tracking.blob_detector:BlobDetector",
    "segmentation": "sim.segmentation:MaskDetector",
}
_FIELD = "sensing.detector"


def check_detector(name: str) -> None:
    """InputError unless `name` is a detector's, or "package.module:Class" that can be imported."""
    if name in DETECTORS:
        return
    if ":" not in name:
        raise InputError(f"{_FIELD}: {name!r} is unknown; {did_you_mean(name, DETECTORS)} (or package.module:Class)")
    _import(name)


def load_detector(name: str, forest: Forest | None) -> Detector | MaskDetector:
    """The detector called `name`, or anyone's as "package.module:Class"; InputError says what is wrong.

    The testbed's own place people who are seen in part with the help of the map, if there is one; anyone's is made
    without arguments.
    """
    check_detector(name)
    made: Any
    if name in DETECTORS:
        made = _import(DETECTORS[name])(forest)
    else:
        try:
            made = _import(name)()
        except TypeError as error:
            raise InputError(f"{_FIELD}: {name!r} cannot be made: {error}") from error
    if not callable(getattr(made, "detect", None)):
        raise InputError(f"{_FIELD}: {name!r} has no method detect(frame)")
    return made  # type: ignore[no-any-return]


def _import(target: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
    try:
        return imported(target)
    except ImportError as error:
        raise InputError(f"{_FIELD}: {target!r} cannot be imported: {error}") from error
