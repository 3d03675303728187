"""Algebra of stacks of small matrices with the same bits on every processor.

BLAS and LAPACK choose their code by processor, and results differ in the last bit. Here every sum is taken in the order
that is written down. For matrices up to about 6 x 6, as Kalman filters have them; larger ones are right, but slow.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from tracking.numerics.compiled import Array, compiled
from tracking.numerics.elementary import log

_SWEEPS = 30  # of Jacobi's method, at most; matrices of 4 x 4 take four to six


def product(left: Array, right: Array) -> Array:
    """Matrix products (..., n, m) of stacks (..., n, k) and (..., k, m), whose leading axes broadcast."""
    left, right = np.asarray(left, dtype=float), np.asarray(right, dtype=float)
    lead = np.broadcast_shapes(left.shape[:-2], right.shape[:-2])
    out = _products(_stack(left, lead, 2), _stack(right, lead, 2))
    return out.reshape(*lead, *out.shape[1:])


def applied(matrices: Array, vectors: Array) -> Array:
    """Products (..., n) of matrices (..., n, k) and vectors (..., k), whose leading axes broadcast."""
    return product(matrices, np.asarray(vectors)[..., None])[..., 0]


def congruent(outer: Array, inner: Array) -> Array:
    """A B Aᵀ (..., n, n), exactly symmetric, of stacks A (..., n, k) and symmetric B (..., k, k)."""
    return symmetric(product(product(outer, inner), np.swapaxes(outer, -1, -2)))


def cholesky(matrices: Array) -> Array:
    """Lower triangular roots (..., n, n) of symmetric positive definite matrices; NaN where one is indefinite.

    An axis without any variance gives a column of zeros; of other semidefinite matrices rounding decides.
    """
    return _unstacked(_roots, matrices)


def forward_solved(roots: Array, right: Array) -> Array:
    """X (..., n, m) with L X = B, of lower triangular L (..., n, n) and B (..., n, m), whose leading axes broadcast."""
    roots, right = np.asarray(roots, dtype=float), np.asarray(right, dtype=float)
    lead = np.broadcast_shapes(roots.shape[:-2], right.shape[:-2])
    return _forward(_stack(roots, lead, 2), _stack(right, lead, 2)).reshape(*lead, *right.shape[-2:])


def inverse(matrices: Array) -> Array:
    """Inverses (..., n, n), exactly symmetric, of symmetric positive definite matrices; NaN for others."""
    return _unstacked(_inverses, matrices)


def log_determinant(matrices: Array) -> Array:
    """Logarithms (...) of the determinants of symmetric positive definite matrices (..., n, n); NaN for others."""
    return _unstacked(_log_determinants, matrices)


def squared_distance(differences: Array, covariances: Array) -> Array:
    """Squared Mahalanobis distances dᵀ P⁻¹ d (...) of d (..., n) and P (..., n, n), whose leading axes broadcast.

    NaN where P is not positive definite.
    """
    differences, covariances = np.asarray(differences, dtype=float), np.asarray(covariances, dtype=float)
    lead = np.broadcast_shapes(differences.shape[:-1], covariances.shape[:-2])
    return _squared_distances(_stack(differences, lead, 1), _stack(covariances, lead, 2)).reshape(lead)


def eigen(matrices: Array) -> tuple[Array, Array]:
    """Eigenvalues (..., n), ascending, and eigenvectors (..., n, n), in columns, of symmetric matrices.

    By Jacobi's method: Golub and Van Loan, Matrix Computations, 8.5.
    """
    matrices = np.asarray(matrices, dtype=float)
    values, vectors = _eigen(_stack(matrices, matrices.shape[:-2], 2))
    return values.reshape(matrices.shape[:-1]), vectors.reshape(matrices.shape)


def symmetric(matrices: Array) -> Array:
    """Matrices (..., n, n) without the asymmetry that rounding left in them."""
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


def length(vectors: Array) -> Array:
    """Euclidean lengths (...) of vectors (..., n)."""
    return np.asarray(np.sqrt(np.sum(np.square(vectors), axis=-1)))


def _stack(array: Array, lead: tuple[int, ...], kept: int) -> Array:
    """The array with its leading axes broadcast and joined into one, contiguous."""
    shape = array.shape[array.ndim - kept :]
    if array.shape == (*lead, *shape) and len(lead) == 1:
        return np.ascontiguousarray(array)
    return np.ascontiguousarray(np.broadcast_to(array, (*lead, *shape))).reshape(math.prod(lead), *shape)


def _unstacked(function: Callable[[Array], Array], matrices: Array) -> Array:
    """A function of a stack (T, n, n) for any leading axes."""
    matrices = np.asarray(matrices, dtype=float)
    out = function(_stack(matrices, matrices.shape[:-2], 2))
    return out.reshape(matrices.shape[:-2] + out.shape[1:])


@compiled
def _products(left: Array, right: Array) -> Array:
    out = np.zeros((len(left), left.shape[1], right.shape[2]))
    for t in range(len(left)):
        for i in range(left.shape[1]):
            for k in range(left.shape[2]):
                for j in range(right.shape[2]):
                    out[t, i, j] += left[t, i, k] * right[t, k, j]
    return out


@compiled
def _roots(matrices: Array) -> Array:
    """Cholesky factors; a pivot of zero gives a column of zeros, a negative one NaN."""
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
def _forward(roots: Array, right: Array) -> Array:
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
def _inverses(matrices: Array) -> Array:
    """Inverses Yᵀ Y, with Y the inverse of the Cholesky factor."""
    n = matrices.shape[1]
    identities = np.zeros_like(matrices)
    for i in range(n):
        identities[:, i, i] = 1.0
    halves, out = _forward(_roots(matrices), identities), np.empty_like(matrices)
    for t in range(len(matrices)):
        for i in range(n):
            for j in range(i, n):
                total = 0.0
                for k in range(j, n):
                    total += halves[t, k, i] * halves[t, k, j]
                out[t, i, j] = out[t, j, i] = total
    return out


@compiled
def _log_determinants(matrices: Array) -> Array:
    roots, out = _roots(matrices), np.zeros(len(matrices))
    for t in range(len(matrices)):
        for i in range(matrices.shape[1]):
            out[t] += 2.0 * log(roots[t, i, i])
    return out


@compiled
def _squared_distances(differences: Array, covariances: Array) -> Array:
    """Sums of squares of the solutions y of L y = d."""
    roots, out = _roots(covariances), np.zeros(len(differences))
    y = np.empty(differences.shape[1])
    for t in range(len(differences)):
        for i in range(len(y)):
            y[i] = differences[t, i]
            for k in range(i):
                y[i] -= roots[t, i, k] * y[k]
            y[i] /= roots[t, i, i]
            out[t] += y[i] * y[i]
    return out


@compiled
def _eigen(matrices: Array) -> tuple[Array, Array]:
    """Eigenvalues (T, n), ascending, and eigenvectors (T, n, n) in columns."""
    n = matrices.shape[1]
    values, vectors = np.empty(matrices.shape[:2]), np.zeros_like(matrices)
    for t in range(len(matrices)):
        A, V = matrices[t].copy(), np.zeros((n, n))
        for i in range(n):
            V[i, i] = 1.0
        for _ in range(_SWEEPS):
            rotations = 0
            for p in range(n - 1):
                for q in range(p + 1, n):
                    rotations += _rotated(A, V, p, q)
            if rotations == 0:
                break
        order = np.argsort(np.diag(A), kind="mergesort")
        for j in range(n):
            values[t, j] = A[order[j], order[j]]
            vectors[t, :, j] = V[:, order[j]]
    return values, vectors


@compiled
def _rotated(A: Array, V: Array, p: int, q: int) -> int:
    """Rotate a symmetric matrix so that A[p, q] becomes zero, and the axes V with it; 0 if it is none already."""
    if abs(A[p, q]) <= 1e-18 * math.sqrt(abs(A[p, p] * A[q, q])) or A[p, q] == 0.0:
        return 0
    theta = (A[q, q] - A[p, p]) / (2.0 * A[p, q])
    t = (1.0 if theta >= 0.0 else -1.0) / (abs(theta) + math.sqrt(theta * theta + 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    A[p, p], A[q, q], A[p, q], A[q, p] = A[p, p] - t * A[p, q], A[q, q] + t * A[p, q], 0.0, 0.0
    for k in range(len(A)):
        if k not in (p, q):
            A[k, p], A[k, q] = c * A[k, p] - s * A[k, q], s * A[k, p] + c * A[k, q]
            A[p, k], A[q, k] = A[k, p], A[k, q]
        V[k, p], V[k, q] = c * V[k, p] - s * V[k, q], s * V[k, p] + c * V[k, q]
    return 1
