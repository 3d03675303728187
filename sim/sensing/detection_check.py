"""Check of the detections that a plug-in returns."""

from __future__ import annotations

import numpy as np

from tracking.detection.detector import Detections
from tracking.numerics.arrays import Array
from tracking.numerics.factorisation import eigen
from tracking.plugins.containment import Unusable, numbers

# Farther ones mean nothing, and surer ones spoil the arithmetic.
_FARTHEST, _SUREST = 1e6, 1e-12  # m, m²
_MOST = 200  # detections of a plug-in in one frame: trackers take seconds over so many


def usable_detections(found: Detections) -> Detections:
    """Detections that trackers can use, as arrays of floats; `Unusable` says what is wrong with them."""
    pixels, ground = numbers("pixels", found.pixels, 2 * _MOST), numbers("ground", found.ground, 2 * _MOST)
    R = numbers("covariances", found.covariances, 4 * _MOST)
    count = len(ground) if ground.ndim else 0
    for name, array, shape in (("pixels", pixels, (2,)), ("ground", ground, (2,)), ("covariances", R, (2, 2))):
        if count or array.size:
            _check_shape(name, array, (count, *shape))
    if count == 0:
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    for name, array, unit in (("ground", ground, "m"), ("pixels", pixels, "pixels")):
        if np.abs(array).max() > _FARTHEST:
            raise Unusable(f"{name} more than {_FARTHEST:g} {unit} away")
    eigenvalues = eigen(R)[0]
    symmetric = bool(np.all(np.abs(R - np.swapaxes(R, 1, 2)) <= 1e-8 + 1e-5 * np.abs(R)))
    if not symmetric or eigenvalues.min() < _SUREST or eigenvalues.max() > _FARTHEST * _FARTHEST:
        raise Unusable("covariances are not symmetric and positive definite, from 1e-12 to 1e12 m²")
    return Detections(pixels, ground, R)


def _check_shape(name: str, array: Array, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise Unusable(f"{name} of shape {array.shape}, not {shape}")
    if not np.all(np.isfinite(array)):
        raise Unusable(f"{name} are not finite")
