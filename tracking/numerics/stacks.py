"""Stacks of vectors and matrices: leading axes that broadcast, joined into one."""

import math
from collections.abc import Callable

import numpy as np

from tracking.numerics.arrays import Array


def common_lead(one: tuple[int, ...], other: tuple[int, ...]) -> tuple[int, ...]:
    """The leading axes to which those of two stacks broadcast."""
    return one if one == other else np.broadcast_shapes(one, other)


def stacked(array: Array, lead: tuple[int, ...], kept: int) -> Array:
    """The array with its leading axes broadcast to `lead` and joined into one, contiguous.

    kept: the number of axes that are not leading.
    """
    shape = array.shape[array.ndim - kept :]
    if array.shape != (*lead, *shape):
        array = np.broadcast_to(array, (*lead, *shape))
    return np.ascontiguousarray(array).reshape(math.prod(lead), *shape)


def mapped_over_stack(function: Callable[[Array], Array], matrices: Array) -> Array:
    """The values of a function of stacks (T, n, n) for matrices (..., n, n) with any leading axes."""
    matrices = np.asarray(matrices, dtype=float)
    out = function(stacked(matrices, matrices.shape[:-2], 2))
    return out.reshape(matrices.shape[:-2] + out.shape[1:])
