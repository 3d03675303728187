"""Checks of the numbers and arrays that plug-ins return."""

import numpy as np

from tracking.numerics.arrays import Array, Indices
from tracking.numerics.factorisation import eigensystems
from tracking.plugins.plugin_error import Unusable

_LEAST, _LARGEST = 1e-12, 1e12  # bounds of eigenvalues, beyond which rounding spoils results


def check_numbers(name: str, given: object) -> Array:
    """Return a new array of floats; raise `Unusable` for other values."""
    try:
        array = np.asarray(given)
        if array.dtype.kind in "biufO":
            return np.array(array, dtype=float, order="C")
    except (TypeError, ValueError, OverflowError):
        pass
    raise Unusable(f"{name} are not numbers")


def check_array(name: str, given: object, shape: tuple[int, ...]) -> Array:
    """Return a new array of finite floats of a shape; raise `Unusable` for anything else."""
    array = check_numbers(name, given)
    if array.shape != shape:
        raise Unusable(f"{name} of shape {array.shape}, not {shape}")
    if not np.all(np.isfinite(array)):
        raise Unusable(f"{name} are not finite")
    return array


def check_whole_numbers(name: str, given: object, shape: tuple[int, ...], kinds: str = "iu") -> Indices:
    """Return a new array of whole numbers of a shape; raise `Unusable` for anything else. kinds: of NumPy types."""
    found = np.asarray(given)
    if found.shape != shape or (found.dtype.kind not in kinds and found.size):
        raise Unusable(f"{name} are not whole numbers of shape {shape}")
    return found.astype(np.int64)


def check_positive_definite(name: str, matrices: Array, unit: str = "") -> None:
    """Raise `Unusable` unless matrices (..., n, n) are symmetric, with eigenvalues from 1e-12 to 1e12."""
    values = eigensystems(np.ascontiguousarray(matrices).reshape(-1, *matrices.shape[-2:]))[0]
    transposed = np.swapaxes(matrices, -1, -2)
    symmetric = np.all(np.abs(matrices - transposed) <= 1e-8 + 1e-5 * np.abs(matrices))
    if not symmetric or not np.all((values >= _LEAST) & (values <= _LARGEST)):
        raise Unusable(f"{name} are not symmetric and positive definite, from 1e-12 to 1e12{unit}")
