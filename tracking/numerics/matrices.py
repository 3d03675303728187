"""Products of stacks of small matrices with the same bits on every processor.

BLAS and LAPACK choose their code by processor, and results differ in the last bit. Here every sum is taken in the order
that is written down. Products are fast for matrices up to about 6 x 6, as in Kalman filters, and correct for any size.
"""

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.stacks import apply_to_stacks


def product(left: Array, right: Array) -> Array:
    """Matrix products (..., n, m) of stacks (..., n, k) and (..., k, m); leading axes broadcast."""
    return apply_to_stacks(products, left, right, axes=(2, 2))


def apply(matrices: Array, vectors: Array) -> Array:
    """Products (..., n) of matrices (..., n, k) and vectors (..., k); leading axes broadcast."""
    return product(matrices, np.asarray(vectors)[..., None])[..., 0]


@compiled
def products(left: Array, right: Array) -> Array:
    """Matrix products (T, n, m) of stacks (T, n, k) and (T, k, m), for compiled code."""
    out = np.zeros((len(left), left.shape[1], right.shape[2]))
    for t in range(len(left)):
        for i in range(left.shape[1]):
            for k in range(left.shape[2]):
                for j in range(right.shape[2]):
                    out[t, i, j] += left[t, i, k] * right[t, k, j]
    return out


@compiled
def transpose(matrices: Array) -> Array:
    """Transposes (T, m, n) of a stack (T, n, m), copied, so that `products` need not be compiled for another layout."""
    out = np.empty((len(matrices), matrices.shape[2], matrices.shape[1]))
    for t in range(len(matrices)):
        for i in range(matrices.shape[1]):
            for j in range(matrices.shape[2]):
                out[t, j, i] = matrices[t, i, j]
    return out


@compiled
def symmetrise(matrices: Array) -> None:
    """Remove the asymmetry that rounding left in matrices (T, n, n), in place."""
    for t in range(len(matrices)):
        for i in range(matrices.shape[1]):
            for j in range(i):
                matrices[t, i, j] = matrices[t, j, i] = 0.5 * (matrices[t, i, j] + matrices[t, j, i])
