"""The check of what plug-ins return: shapes, finite numbers and bounds, as each caller declares them by field."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tracking.errors import spell
from tracking.numerics.arrays import Array
from tracking.numerics.factorisation import eigensystems
from tracking.plugins.plugin_error import Unusable

_LEAST, _LARGEST = 1e-12, 1e12  # bounds of eigenvalues, beyond which rounding spoils results


@dataclass(frozen=True)
class Form:
    """What an array from a plug-in has to be; `check` gives a new array of floats or whole numbers."""

    axes: tuple[int, ...] = ()  # lengths of the axes after the given ones
    whole: str = ""  # kinds of NumPy types, as "iu", if numbers have to be whole
    unset: bool = False  # -inf is allowed, for what is not known yet
    definite: bool = False  # the last two axes are those of symmetric and positive definite matrices
    farthest: float = np.inf  # largest absolute value
    unit: str = ""

    def check(self, name: str, given: object, *counts: int) -> Any:  # noqa: ANN401 - floats or whole numbers
        """The array, with axes of lengths `counts` first; `Unusable` names what is wrong."""
        shape = (*counts, *self.axes)
        if self.whole:
            found = np.asarray(given)
            if found.shape != shape or (found.dtype.kind not in self.whole and found.size):
                raise Unusable(f"{name} are not whole numbers of shape {shape}")
            return found.astype(np.int64)
        array = read_numbers(name, given)
        if self.unset:
            if array.shape != shape or np.isnan(array).any() or np.any(array == np.inf):
                raise Unusable(f"{name} are not numbers of shape {shape}")
            return array
        if array.shape != shape:
            raise Unusable(f"{name} of shape {array.shape}, not {shape}")
        if not np.all(np.isfinite(array)):
            raise Unusable(f"{name} are not finite")
        if np.abs(array).max(initial=0.0) > self.farthest:
            raise Unusable(f"{name} more than {spell(self.farthest)} {self.unit} away")
        if self.definite and not _are_definite(array):
            unit = f" {self.unit}" if self.unit else ""
            raise Unusable(f"{name} are not symmetric and positive definite, from 1e-12 to 1e12{unit}")
        return array


WHOLE = Form(whole="iu")
COVARIANCES = Form((4, 4), definite=True)  # of states


def check_fields(given: object, forms: Mapping[str, Form], count: int) -> dict[str, Any]:
    """Arrays of the fields of an object, with `count` rows each, by name."""
    return {name: form.check(name, getattr(given, name), count) for name, form in forms.items()}


def check_kind(name: str, given: object, kind: type) -> None:
    """Raise `Unusable` unless a result is of a class."""
    if not isinstance(given, kind):
        raise Unusable(f"{name}: {type(given).__name__} is no {kind.__module__}.{kind.__qualname__}")


def read_numbers(name: str, given: object) -> Array:
    """A new array of floats; `Unusable` for other values."""
    try:
        array = np.asarray(given)
        if array.dtype.kind in "biufO":
            return np.array(array, dtype=float, order="C")
    except (TypeError, ValueError, OverflowError):
        pass
    raise Unusable(f"{name} are not numbers")


def _are_definite(matrices: Array) -> bool:
    """True if matrices (..., n, n) are symmetric, with eigenvalues from 1e-12 to 1e12."""
    values = eigensystems(matrices.reshape(-1, *matrices.shape[-2:]))[0]
    close = np.abs(matrices - np.swapaxes(matrices, -1, -2)) <= 1e-8 + 1e-5 * np.abs(matrices)
    return bool(np.all(close) and np.all((values >= _LEAST) & (values <= _LARGEST)))
