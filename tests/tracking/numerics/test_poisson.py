import numpy as np
import pytest

from tracking.numerics.poisson import poisson


@pytest.mark.parametrize("mean", [0.0, 1e-9, 0.02, 1.0, 9.99, 10.0, 10.5, 75.0, 1000.0, 10_000.0])
def test_numbers_are_those_that_numpy_draws_from_the_same_stream(mean):
    ours, theirs = np.random.default_rng(7), np.random.default_rng(7)
    assert [poisson(ours, mean) for _ in range(2000)] == theirs.poisson(mean, 2000).tolist()
    assert ours.random() == theirs.random()
