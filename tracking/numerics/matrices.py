"""Products of stacks of small matrices with the same bits on every processor.

BLAS and LAPACK choose their code by processor, and results differ in the last bit. Here every sum is taken in the order
that is written down. For matrices up to about 6 x 6, as Kalman filters have them; larger ones are right, but slow.
"""

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.stacks import over_stacks


def product(left: Array, right: Array) -> Array:
    """Matrix products (..., n, m) of stacks (..., n, k) and (..., k, m); leading axes broadcast."""
    return over_stacks(products, (left, 2), (right, 2))


def applied(matrices: Array, vectors: Array) -> Array:
    """Products (..., n) of matrices (..., n, k) and vectors (..., k); leading axes broadcast."""
    return product(matrices, np.asarray(vectors)[..., None])[..., 0]


def congruent(outer: Array, inner: Array) -> Array:
    """A B Aᵀ (..., n, n), exactly symmetric, of stacks A (..., n, k) and symmetric B (..., k, k)."""
    return symmetric(product(product(outer, inner), np.swapaxes(outer, -1, -2)))


def symmetric(matrices: Array) -> Array:
    """Matrices (..., n, n) without the asymmetry that rounding left in them."""
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


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
