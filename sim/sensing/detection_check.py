"""Check of the detections that a plug-in returns."""

import math

import numpy as np

from tracking.detection.detector import Detections
from tracking.plugins.containment import Unusable, numbers
from tracking.plugins.results import check_positive_definite, checked_array

_SHAPES = {"pixels": (2,), "ground": (2,), "covariances": (2, 2)}  # of one detection
_FARTHEST = 1e6  # m or pixels: farther ones mean nothing
_MOST = 200  # detections of a plug-in in one frame: trackers take seconds over so many


def usable_detections(found: Detections) -> Detections:
    """Detections that trackers can use, as arrays of floats; `Unusable` says what is wrong with them."""
    arrays = {name: numbers(name, getattr(found, name), _MOST * math.prod(each)) for name, each in _SHAPES.items()}
    if not any(array.size for array in arrays.values()):
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    count = len(arrays["ground"]) if arrays["ground"].ndim else 0
    usable = {name: checked_array(name, array, (count, *_SHAPES[name])) for name, array in arrays.items()}
    for name, unit in (("ground", "m"), ("pixels", "pixels")):
        if np.abs(usable[name]).max(initial=0.0) > _FARTHEST:
            raise Unusable(f"{name} more than {_FARTHEST:g} {unit} away")
    check_positive_definite("covariances", usable["covariances"], " m²")
    return Detections(**usable)
