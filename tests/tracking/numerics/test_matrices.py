"""Algebra of small matrices against LAPACK's."""

import numpy as np
import pytest

from tracking.numerics import distances, factorisation, matrices
from tracking.numerics.stacks import cholesky_factors, forward_solutions, row_sums

_RNG = np.random.default_rng(7)


def _definite(n, *lead, spread=3.0):
    """Random positive definite matrices (*lead, n, n) with axes that differ by some orders of magnitude."""
    axes = np.linalg.qr(_RNG.normal(size=(*lead, n, n)))[0]
    return (axes * 10.0 ** _RNG.uniform(-spread, spread, (*lead, 1, n))) @ np.swapaxes(axes, -1, -2)


@pytest.mark.parametrize(
    "shapes", [((3, 4), (4, 2)), ((5, 3, 4), (4, 2)), ((5, 1, 2, 2), (6, 2, 2)), ((0, 2, 2), (2, 2))]
)
def test_products_broadcast_as_numpy_has_them(shapes):
    left, right = (_RNG.normal(size=shape) for shape in shapes)
    np.testing.assert_allclose(matrices.product(left, right), left @ right, rtol=1e-13, atol=1e-14)


def test_transposes_and_symmetric_parts_agree_with_numpy():
    wide = _RNG.normal(size=(6, 3, 4))
    np.testing.assert_array_equal(matrices.transpose(wide), np.swapaxes(wide, 1, 2))
    square = _RNG.normal(size=(6, 4, 4))
    expected = 0.5 * (square + np.swapaxes(square, 1, 2))
    matrices.symmetrise(square)
    assert np.array_equal(square, expected)


def test_a_matrix_applies_to_vectors_along_the_last_axis():
    left, right = _RNG.normal(size=(4, 1, 3, 2)), _RNG.normal(size=(5, 2))
    expected = np.einsum("abij,bj->abi", left.repeat(5, 1), right)
    np.testing.assert_allclose(matrices.apply(left, right), expected, rtol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_roots_and_inverses_agree_with_lapack(n):
    P = _definite(n, 50, spread=1.0)
    np.testing.assert_allclose(cholesky_factors(P), np.linalg.cholesky(P), rtol=1e-9)
    np.testing.assert_allclose(factorisation.inverses(P), np.linalg.inv(P), rtol=1e-7, atol=1e-12)
    assert np.array_equal(factorisation.inverses(P), np.swapaxes(factorisation.inverses(P), 1, 2))


def test_matrices_without_variance_have_zero_roots_and_indefinite_ones_none():
    singular = np.array([np.zeros((4, 4)), np.diag([1.0, 0.0, 4.0, 0.0])])
    roots = cholesky_factors(singular)
    assert np.array_equal(roots @ np.swapaxes(roots, 1, 2), singular)
    wrong = np.array([[[1.0, 2.0], [2.0, 1.0]]])
    assert np.isnan(cholesky_factors(wrong)[0, 1, 1])
    assert np.isnan(distances.gaussian_costs(np.ones(2), wrong)).all()
    assert np.isnan(distances.squared_distance(np.ones(2), wrong)).all()
    assert np.isnan(factorisation.inverses(wrong)).any()


@pytest.mark.parametrize("n", [1, 2, 4])
def test_distances_and_costs_of_pairs_agree_with_lapack(n):
    P, d = _definite(n, 6, 1), _RNG.normal(size=(5, n))
    solved = np.linalg.solve(np.broadcast_to(P, (6, 5, n, n)), np.broadcast_to(d, (6, 5, n))[..., None])[..., 0]
    expected = (solved * d).sum(axis=-1)
    np.testing.assert_allclose(distances.squared_distance(d, P), expected, rtol=1e-8)
    costs = distances.gaussian_costs(-d, 0.75 * P)
    np.testing.assert_allclose(costs, expected / 0.75 + np.linalg.slogdet(0.75 * P)[1], rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_eigenvalues_ascend_and_rebuild_the_matrix(n):
    P = _definite(n, 40) - 2.0 * np.eye(n)
    values, vectors = factorisation.eigensystems(P)
    scale = np.abs(values).max(axis=1)
    assert np.all(np.diff(values, axis=1) >= 0)
    assert np.all(np.abs(values - np.linalg.eigvalsh(P)).max(axis=1) < 1e-13 * scale)
    rebuilt = (vectors * values[:, None]) @ np.swapaxes(vectors, 1, 2)
    assert np.all(np.abs(rebuilt - P).max(axis=(1, 2)) < 1e-13 * scale)
    np.testing.assert_allclose(vectors @ np.swapaxes(vectors, 1, 2), np.broadcast_to(np.eye(n), P.shape), atol=1e-13)


def test_equal_eigenvalues_keep_axes_and_forward_solutions_solve():
    (values,), (vectors,) = factorisation.eigensystems(np.diag([2.0, 1.0, 2.0])[None])
    assert values.tolist() == [1.0, 2.0, 2.0] and np.array_equal(np.abs(vectors) @ [1.0, 2.0, 3.0], [2.0, 1.0, 3.0])
    L, B = cholesky_factors(_definite(4, 7, spread=1.0)), _RNG.normal(size=(7, 4, 3))
    np.testing.assert_allclose(L @ forward_solutions(L, B), B, atol=1e-10)


def test_lengths_are_euclidean():
    assert distances.length(np.array([[3.0, 4.0], [0.0, 0.0]])).tolist() == [5.0, 0.0]
    for vectors in (np.random.default_rng(n).normal(0, 30, (40, 30, n)) for n in (2, 3, 40)):
        np.testing.assert_array_equal(distances.length(vectors), np.sqrt(np.sum(np.square(vectors), axis=-1)))


@pytest.mark.parametrize("count", [8, 15, 36, 128])
def test_row_sums_are_numpys_to_the_bit(count):
    rows = np.random.default_rng(count).normal(size=(200, count)) * 10.0 ** np.arange(200)[:, None] / 1e100
    np.testing.assert_array_equal(row_sums(rows), rows.sum(axis=1))
