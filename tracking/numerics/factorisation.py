"""Inverses and eigenvalues of contiguous stacks of matrices; the method is that of `numerics.matrices`."""

import math

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.matrices import products, transpose
from tracking.numerics.stacks import cholesky_factors, triangular_inverses

_SWEEPS = 30  # most sweeps of Jacobi's method; matrices of 4 x 4 take four to six


@compiled
def inverses(matrices: Array) -> Array:
    """Exactly symmetric inverses (T, n, n) of symmetric positive definite matrices; NaN for others.

    They are Yᵀ Y, where Y is the inverse of the Cholesky factor.
    """
    halves = triangular_inverses(cholesky_factors(matrices))
    return products(transpose(halves), halves)


@compiled
def eigensystems(matrices: Array) -> tuple[Array, Array]:
    """Ascending eigenvalues (T, n) and eigenvectors (T, n, n), in columns, of symmetric matrices.

    Source: Jacobi's method, Golub and Van Loan, Matrix Computations, 8.5.
    """
    n = matrices.shape[1]
    values, vectors = np.empty(matrices.shape[:2]), np.zeros_like(matrices)
    for t in range(len(matrices)):
        A, V = matrices[t].copy(), vectors[t]
        for i in range(n):
            V[i, i] = 1.0
        for _ in range(_SWEEPS):
            rotations = 0
            for p in range(n - 1):
                for q in range(p + 1, n):
                    rotations += _rotate(A, V, p, q)
            if rotations == 0:
                break
        for i in range(n):
            values[t, i] = A[i, i]
        _sort(values[t], V)
    return values, vectors


@compiled
def _sort(values: Array, vectors: Array) -> None:
    """Sort values (n,), ascending, and vectors (n, n), in columns, with them."""
    for last in range(1, len(values)):
        for j in range(last, 0, -1):
            if not values[j] < values[j - 1]:
                break
            values[j - 1], values[j] = values[j], values[j - 1]
            for i in range(len(values)):
                vectors[i, j - 1], vectors[i, j] = vectors[i, j], vectors[i, j - 1]


@compiled
def _rotate(A: Array, V: Array, p: int, q: int) -> int:
    """Rotate a symmetric matrix A, and the axes V with it, so that A[p, q] becomes zero; 0 if it is already zero."""
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
