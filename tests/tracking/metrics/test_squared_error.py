"""The expected squared error up to a cut-off against the integral over errors, and against drawn ones."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from tracking.metrics.squared_error import cut_off


def expected(traces, cutoff):
    found = np.array(traces, dtype=float)
    cut_off(found, cutoff)
    return found


@pytest.mark.parametrize("cutoff", [0.5, 10.0, 40.0])
def test_the_expected_squared_error_is_the_integral_over_all_errors(cutoff):
    traces = np.geomspace(1e-3 * cutoff**2, 1e4 * cutoff**2, 15)
    for trace, found in zip(traces, expected(traces, cutoff), strict=True):
        # The length of an error in the plane, of variance `trace` / 2 along each axis, has Rayleigh's density.
        inside = quad(lambda r, t=trace: r**2 * 2 * r / t * math.exp(-(r**2) / t), 0.0, cutoff, limit=200)[0]
        assert found == pytest.approx(inside + cutoff**2 * math.exp(-(cutoff**2) / trace), rel=1e-7)


def test_a_trace_far_below_the_cutoff_keeps_its_bits_and_none_passes_its_square():
    traces = np.array([0.0, 1e-6, 0.03, 1.0, 2.6, 1e9])
    found = expected(traces, 10.0)
    assert found[:5].tolist() == traces[:5].tolist()
    assert found[5] == pytest.approx(100.0, rel=1e-6) and found[5] <= 100.0
    assert expected(traces, math.inf).tolist() == traces.tolist()


@pytest.mark.parametrize("oblong", [1.0, 4.0, 1e9])
def test_drawn_errors_of_oblong_covariances_are_at_most_a_fifth_less(oblong):
    draws, worst = np.random.default_rng(0).standard_normal((200_000, 2)), []
    for trace in (5.0, 50.0, 100.0, 200.0, 1000.0):
        variances = np.array([oblong, 1.0]) * trace / (oblong + 1.0)
        drawn = np.minimum((draws**2 * variances).sum(axis=1), 100.0).mean()
        worst.append(drawn / expected([trace], 10.0)[0])
    low = {1.0: 0.99, 4.0: 0.9, 1e9: 0.8}[oblong]
    assert low <= min(worst) and max(worst) <= 1.01
