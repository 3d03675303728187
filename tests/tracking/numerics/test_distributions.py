"""The normal distribution against SciPy's, Poisson numbers against NumPy's."""

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

from tracking.numerics import normal
from tracking.numerics.poisson import draw_poisson


def test_normal_distribution_and_quantiles_agree_with_scipy():
    x = np.linspace(-37.0, 37.0, 4001)
    np.testing.assert_allclose(normal.normal_cdf_each(x), ndtr(x), rtol=0.0, atol=1e-15)
    below = x[x < 0.0]  # where an absolute error of 1e-15 says little
    np.testing.assert_allclose(normal.normal_cdf_each(below), ndtr(below), rtol=1e-8)
    np.testing.assert_array_equal(normal.normal_cdf_each(np.array([-np.inf, 0.0, np.inf])), [0.0, 0.5, 1.0])
    p = [np.linspace(0.0, 1.0, 4001)[1:-1], 10.0 ** np.arange(-300, -1, 7.0), 1 - 2.0 ** -np.arange(2, 53)]
    p = np.concatenate(p)
    np.testing.assert_allclose(normal.normal_quantiles(p), ndtri(p), rtol=2e-15, atol=1e-16)


class Fixed:
    """A generator of these uniform numbers."""

    def __init__(self, numbers):
        self.numbers = numbers

    def random(self, shape):
        return np.resize(self.numbers, shape)


def test_drawn_normal_numbers_are_scipys_quantiles_of_uniform_ones_with_the_moments_of_their_distribution():
    drawn = normal.standard_normal(np.random.default_rng(3), (1000, 1000))
    errors = [np.mean(drawn), np.mean(drawn**2) - 1, np.mean(drawn**3), np.mean(drawn**4) - 3]
    # Four standard deviations of the means of a million draws.
    assert np.all(np.abs(errors) < 4e-3 * np.sqrt([1.0, 2.0, 15.0, 96.0]))
    uniform = np.random.default_rng(3).random((1000, 1000))
    np.testing.assert_allclose(drawn, ndtri(uniform), rtol=2e-15, atol=1e-16)
    # Zero stands for half the step between uniform numbers, and is finite; all others are as they are.
    ends = np.array([0.0, 2.0**-53, 0.5, 1.0 - 2.0**-53])
    found = normal.standard_normal(Fixed(ends), (2, 2))
    np.testing.assert_allclose(found, ndtri([[2.0**-54, 2.0**-53], [0.5, 1.0 - 2.0**-53]]), rtol=2e-15, atol=1e-16)
    assert np.shape(normal.standard_normal(np.random.default_rng(0), 3)) == (3,)


@pytest.mark.parametrize("mean", [0.0, 1e-9, 0.02, 1.0, 9.99, 10.0, 10.5, 75.0, 1000.0, 10_000.0])
def test_poisson_numbers_are_those_that_numpy_draws_from_the_same_stream(mean):
    ours, theirs = np.random.default_rng(7), np.random.default_rng(7)
    assert [draw_poisson(ours, mean) for _ in range(2000)] == theirs.poisson(mean, 2000).tolist()
    assert ours.random() == theirs.random()
