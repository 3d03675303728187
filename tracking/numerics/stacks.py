"""Stacks of vectors and matrices: broadcasting and joining of leading axes, and compiled loops over such stacks."""

import math
from collections.abc import Callable
from functools import wraps

import numpy as np
from numpy.typing import ArrayLike

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled


def _stack(array: Array, lead: tuple[int, ...], kept: int) -> Array:
    """The array with its leading axes broadcast to `lead` and joined into one, contiguous and writeable.

    kept: the number of axes that are not leading. For other arrays Numba would compile a function once more.
    """
    shape = array.shape[array.ndim - kept :]
    if array.shape != (*lead, *shape) or not array.flags.writeable:
        array = np.broadcast_to(array, (*lead, *shape)).copy()
    return np.ascontiguousarray(array).reshape(math.prod(lead), *shape)


def apply_to_stacks(function: Callable[..., Array], *arrays: ArrayLike, axes: tuple[int, ...]) -> Array:
    """Values of a function of stacks (T, ...) for arrays with leading axes that broadcast.

    axes: for each array the number of its axes that are not leading.
    """
    given = [(np.asarray(array, dtype=float), kept) for array, kept in zip(arrays, axes, strict=True)]
    leads = [array.shape[: array.ndim - kept] for array, kept in given]
    lead = leads[0] if leads.count(leads[0]) == len(leads) else np.broadcast_shapes(*leads)
    out = function(*(_stack(array, lead, kept) for array, kept in given))
    return out.reshape(lead + out.shape[1:])


def elementwise(loop: Callable[..., Array]) -> Callable[..., Array]:
    """Make a function of arrays that broadcast from a `compiled` loop over flat arrays, which returns a flat array.

    Numba's own universal functions take 0.03 s each to load, in every process.
    """

    @wraps(loop)
    def each(*values: ArrayLike) -> Array:
        return apply_to_stacks(loop, *values, axes=(0,) * len(values))

    return each


@compiled
def row_sums(rows: Array) -> Array:
    """Sums (T,) of rows (T, n) of 8 to 128 numbers in NumPy's order: eight sums, joined in pairs, then the rest."""
    out, sums = np.empty(len(rows)), np.empty(8)
    whole = rows.shape[1] - rows.shape[1] % 8
    for t in range(len(rows)):
        for k in range(8):
            sums[k] = rows[t, k]
        for k in range(8, whole):
            sums[k % 8] += rows[t, k]
        total = ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]))
        for k in range(whole, rows.shape[1]):
            total += rows[t, k]
        out[t] = total
    return out


@compiled
def cholesky_factors(matrices: Array) -> Array:
    """Cholesky factors of a contiguous stack (T, n, n): a zero pivot gives a column of zeros, a negative one NaN."""
    out, n = np.zeros_like(matrices), matrices.shape[1]
    for t in range(len(matrices)):
        for j in range(n):
            for i in range(j, n):
                rest = matrices[t, i, j]
                for k in range(j):
                    rest -= out[t, i, k] * out[t, j, k]
                if i == j:
                    out[t, j, j] = math.sqrt(rest) if rest >= 0.0 else math.nan
                else:
                    out[t, i, j] = 0.0 if out[t, j, j] == 0.0 else rest / out[t, j, j]
    return out


@compiled
def forward_solutions(roots: Array, right: Array) -> Array:
    """Solutions (T, n, m) of L X = B for stacks L (T, n, n), lower triangular, and B (T, n, m)."""
    out = np.empty_like(right)
    for t in range(len(right)):
        for i in range(right.shape[1]):
            for j in range(right.shape[2]):
                rest = right[t, i, j]
                for k in range(i):
                    rest -= roots[t, i, k] * out[t, k, j]
                out[t, i, j] = rest / roots[t, i, i]
    return out


@compiled
def triangular_inverses(roots: Array) -> Array:
    """Inverses (T, n, n) of a stack of lower triangular matrices."""
    right = np.zeros_like(roots)
    for t in range(len(right)):
        for i in range(right.shape[1]):
            right[t, i, i] = 1.0
    return forward_solutions(roots, right)
