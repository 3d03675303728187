"""Checks of the arrays that plug-ins return."""

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.factorisation import eigen
from tracking.plugins.containment import Unusable, numbers

_MOST = 1_000_000  # numbers of an array: more would take seconds
_LEAST, _LARGEST = 1e-12, 1e12  # eigenvalues beyond spoil the arithmetic


def checked_array(name: str, given: object, shape: tuple[int, ...]) -> Array:
    """A new array of finite floats of a shape; `Unusable` for anything else."""
    array = numbers(name, given, _MOST)
    if array.shape != shape:
        raise Unusable(f"{name} of shape {array.shape}, not {shape}")
    if not np.all(np.isfinite(array)):
        raise Unusable(f"{name} are not finite")
    return array


def check_positive_definite(name: str, matrices: Array, unit: str = "") -> None:
    """`Unusable` unless matrices (..., n, n) are symmetric, with eigenvalues from 1e-12 to 1e12."""
    values, transposed = eigen(matrices)[0], np.swapaxes(matrices, -1, -2)
    symmetric = np.all(np.abs(matrices - transposed) <= 1e-8 + 1e-5 * np.abs(matrices))
    if not symmetric or not np.all((values >= _LEAST) & (values <= _LARGEST)):
        raise Unusable(f"{name} are not symmetric and positive definite, from 1e-12 to 1e12{unit}")
