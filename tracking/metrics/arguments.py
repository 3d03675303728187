"""Checks of the arguments of metrics between sets."""

import math

import numpy as np

from tracking.numerics.arrays import Array


def check_metric(c: float, p: float) -> None:
    """Raise ValueError unless the cut-off c [m] and the order p are those of a metric whose powers are floats."""
    if not (1e-9 <= c <= 1e9 and 1 <= p <= 10):
        raise ValueError(f"c must be from 1e-9 to 1e9 and p from 1 to 10, are {c} and {p}")


def check_positions(name: str, positions: Array) -> Array:
    """Return positions as an array (A, 2); an empty one may also be (0,) or (0, n).

    Raises ValueError for other shapes, as of states, and for positions that are not finite.
    """
    found = np.asarray(positions, dtype=float)
    if found.ndim > 2 or (found.size and found.shape[1:] != (2,)):
        raise ValueError(f"{name} must be (A, 2), are {found.shape}")
    found = found.reshape(-1, 2)
    if not all(map(math.isfinite, found.ravel().tolist())):  # faster than NumPy's for a few
        first = np.isfinite(found).all(axis=1).argmin()
        raise ValueError(f"{name}[{first}] is not finite; leave absent ones out")
    return found
