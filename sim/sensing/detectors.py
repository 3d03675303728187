"""Registry of detectors: by name, or by import string."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sim.scenario.errors import InputError
from tracking.plugins.containment import ForeignError, contained
from tracking.plugins.importing import imported
from tracking.plugins.spelling import did_you_mean

if TYPE_CHECKING:  # checking a name needs none of their code
    from sim.sensing.mask_detector import MaskDetector
    from tracking.detection.detector import Detector
    from tracking.geometry.visibility import Forest

DETECTORS = {
    "blob": "tracking.detection.blob_detector:BlobDetector",
    "segmentation": "sim.sensing.mask_detector:MaskDetector",
}
_FIELD = "sensing.detector"


def check_detector(name: str) -> None:
    """InputError unless `name` is a built-in detector, or "package.module:Class" that can be imported."""
    if not is_built_in_detector(name):
        _import(name)


def is_built_in_detector(name: str) -> bool:
    """True if a detector is built in; InputError if the name is neither that nor an import string."""
    if name not in DETECTORS and ":" not in name:
        raise InputError(f"{_FIELD}: {name!r} is unknown; {did_you_mean(name, DETECTORS)} (or package.module:Class)")
    return name in DETECTORS


def load_detector(name: str, forest: Forest | None) -> Detector | MaskDetector:
    """The detector called `name`, or of a plug-in as "package.module:Class"; InputError says what is wrong.

    Built-in detectors locate partly visible people with the map, if there is one; a plug-in is made without arguments.
    """
    check_detector(name)
    make = _import(DETECTORS.get(name, name))
    try:
        with contained():
            made = make(forest) if name in DETECTORS else make()
            usable = callable(getattr(made, "detect", None))
    except ForeignError as error:
        raise InputError(f"{_FIELD}: {name!r} cannot be made: {error.explained}") from error
    if not usable:
        raise InputError(f"{_FIELD}: {name!r} has no method detect(frame)")
    return made  # type: ignore[no-any-return]


def _import(target: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
    try:
        return imported(target)
    except ImportError as error:
        raise InputError(f"{_FIELD}: {target!r} cannot be imported: {error}") from error
