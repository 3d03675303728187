"""Checks of the arrays that plug-ins return, and of changes to their arguments, which they must leave as they are."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from tracking.numerics.arrays import Array, Indices
from tracking.numerics.factorisation import eigensystems
from tracking.plugins.containment import Unusable, numbers

_MOST = 1_000_000  # numbers of an array: more would take seconds
_LEAST, _LARGEST = 1e-12, 1e12  # bounds of eigenvalues, beyond which rounding spoils results


def checked_array(name: str, given: object, shape: tuple[int, ...]) -> Array:
    """A new array of finite floats of a shape; `Unusable` for anything else."""
    array = numbers(name, given, _MOST)
    if array.shape != shape:
        raise Unusable(f"{name} of shape {array.shape}, not {shape}")
    if not np.all(np.isfinite(array)):
        raise Unusable(f"{name} are not finite")
    return array


def whole_numbers(name: str, given: object, shape: tuple[int, ...], kinds: str = "iu") -> Indices:
    """A new array of whole numbers of a shape; `Unusable` for anything else. kinds: of NumPy types, allowed."""
    found = np.asarray(given)
    if found.shape != shape or found.dtype.kind not in kinds:
        raise Unusable(f"{name} are no table {shape} of whole numbers")
    return found.astype(np.int64)


def check_positive_definite(name: str, matrices: Array, unit: str = "") -> None:
    """Raise `Unusable` unless matrices (..., n, n) are symmetric, with eigenvalues from 1e-12 to 1e12."""
    values = eigensystems(np.ascontiguousarray(matrices).reshape(-1, *matrices.shape[-2:]))[0]
    transposed = np.swapaxes(matrices, -1, -2)
    symmetric = np.all(np.abs(matrices - transposed) <= 1e-8 + 1e-5 * np.abs(matrices))
    if not symmetric or not np.all((values >= _LEAST) & (values <= _LARGEST)):
        raise Unusable(f"{name} are not symmetric and positive definite, from 1e-12 to 1e12{unit}")


def contents(value: Any, path: str) -> dict[str, object]:  # noqa: ANN401 - whatever a value holds
    """Contents of a value by path: fields, entries, and arrays with their write flags."""
    if isinstance(value, np.ndarray):
        return {path: (value.dtype.str, value.shape, value.tobytes()), f"writing to {path}": value.flags.writeable}
    if is_dataclass(value):
        parts = {f"{path}.{f.name}": getattr(value, f.name) for f in fields(value)}
    elif isinstance(value, Mapping):
        parts = {f"{path}[{key!r}]": entry for key, entry in value.items()}
    elif isinstance(value, list | tuple):
        parts = {f"{path}[{k}]": entry for k, entry in enumerate(value)}
    else:
        return {path: value}
    found: dict[str, object] = {f"{path}, what it holds": tuple(parts)}
    for name, part in parts.items():
        found |= contents(part, name)
    return found


def change(before: Mapping[str, object], after: Mapping[str, object]) -> str:
    """The first difference of two `contents`, in words; empty if there is none."""
    for path, value in before.items():
        if path not in after or after[path] != value:
            return f"{path} is changed"
    return ""
