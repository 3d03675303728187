"""Euclidean and Mahalanobis distances of stacks of vectors; the method is that of `tracking.numerics.matrices`."""

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import log
from tracking.numerics.stacks import apply_to_stacks, cholesky_factors, forward_solutions


def length(vectors: Array) -> Array:
    """Euclidean lengths (...) of vectors (..., n)."""
    squares = np.square(vectors)
    if squares.shape[-1] == 2:  # of many vectors, the same sum in a sixth of the time
        return np.asarray(np.sqrt(squares[..., 0] + squares[..., 1]))
    return np.asarray(np.sqrt(np.sum(squares, axis=-1)))


def squared_distance(differences: Array, covariances: Array) -> Array:
    """Squared Mahalanobis distances dᵀ P⁻¹ d (...) of d (..., n) and P (..., n, n); leading axes broadcast.

    NaN where P is not positive definite.
    """
    return apply_to_stacks(_squared_distances, differences, covariances, axes=(1, 2))


def gaussian_costs(differences: Array, covariances: Array) -> Array:
    """Twice the negative log-densities (...), up to a constant, of Gaussians of mean zero at differences (..., n).

    NaN where the covariance (..., n, n) is not positive definite.
    """
    distances = squared_distance(differences, covariances)
    return distances + apply_to_stacks(_log_determinants, covariances, axes=(2,))


@compiled
def _log_determinants(matrices: Array) -> Array:
    """Logarithms (T,) of the determinants of symmetric positive definite matrices (T, n, n); NaN for others."""
    roots, out = cholesky_factors(matrices), np.zeros(len(matrices))
    for t in range(len(matrices)):
        for i in range(matrices.shape[1]):
            out[t] += 2.0 * log(roots[t, i, i])
    return out


@compiled
def _squared_distances(differences: Array, covariances: Array) -> Array:
    """Squared Mahalanobis distances (T,) of stacks (T, n) and (T, n, n), as yᵀ y with the solution y of L y = d."""
    y = forward_solutions(cholesky_factors(covariances), differences.reshape(*differences.shape, 1))
    out = np.zeros(len(y))
    for t in range(len(y)):
        for i in range(y.shape[1]):
            out[t] += y[t, i, 0] * y[t, i, 0]
    return out
