"""Elementary functions against arithmetic of 40 digits."""

import math

import mpmath
import numpy as np
import pytest

from tracking.numerics import exponential, trigonometry

_RNG = np.random.default_rng(20261122)
_WIDE = np.concatenate([_RNG.normal(0, 1, 1000), _RNG.normal(0, 100, 1000), _RNG.uniform(-1e-6, 1e-6, 200)])
_POSITIVE = np.concatenate([np.exp(_RNG.uniform(-700, 700, 1000)), _RNG.uniform(0.5, 2, 1000), [5e-324, 1.0, 1e-310]])
_DIRECTIONS = np.concatenate([_RNG.normal(0, 1, (2000, 2)), _RNG.normal(0, 1, (500, 2)) * [1e-9, 1.0]])


_SMALL = _RNG.uniform(-0.8, 0.8, 2000) * 10.0 ** _RNG.integers(-12, 1, 2000)


def _units(found, function, *arguments):
    """Errors in units of the last place of the true value."""
    with mpmath.workdps(40):
        true = [function(*map(mpmath.mpf, xs)) for xs in zip(*(a.tolist() for a in arguments), strict=True)]
        pairs = zip(found.tolist(), true, strict=True)
        return np.array([abs(mpmath.mpf(f) - t) / math.ulp(float(t)) for f, t in pairs])


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_and_cosine_are_exact_to_three_ten_quadrillionths(name):
    angles = np.concatenate([_WIDE, _RNG.uniform(-1e5, 1e5, 1000), np.arange(-40, 41) * (math.pi / 4)])
    found = getattr(trigonometry, f"{name}_each")(angles)
    with mpmath.workdps(40):
        true = np.array([getattr(mpmath, name)(mpmath.mpf(x)) for x in angles.tolist()])
    assert np.abs(found - true).max() < 3e-16


PRECISE = {
    "exponential": (exponential.exp_each, mpmath.exp, _WIDE),
    "logarithm": (lambda xs: np.array([exponential.log(x) for x in xs.tolist()]), mpmath.log, _POSITIVE),
    "sine of small angles": (trigonometry.sin_each, mpmath.sin, _SMALL),
    "direction": (trigonometry.arctan2_each, mpmath.atan2, *_DIRECTIONS.T),
}


def test_logarithms_side_by_side_are_those_one_by_one():
    normal = _POSITIVE[_POSITIVE > 1e-307]
    found = normal.copy()
    exponential.replace_by_logs(found)
    np.testing.assert_array_equal(found, [exponential.log(x) for x in normal.tolist()])


@pytest.mark.parametrize("name", PRECISE)
def test_elementary_functions_are_within_two_units_in_the_last_place(name):
    ours, true, *arguments = PRECISE[name]
    assert _units(ours(*arguments), true, *arguments).max() < 2


def test_tangents_have_fifteen_digits_and_directions_along_axes_are_exact():
    along = [(0, 1), (1, 0), (0, -1), (-1, 0), (0, 0)]
    found = [trigonometry.arctan2(float(y), float(x)) for y, x in along]
    assert found == [0.0, math.pi / 2, math.pi, -math.pi / 2, 0.0]
    angles = _RNG.uniform(-1.5, 1.5, 1000)
    found = np.array([trigonometry.tan(x) for x in angles.tolist()])
    np.testing.assert_allclose(found, [float(mpmath.tan(x)) for x in angles], rtol=1e-15)


@pytest.mark.parametrize("exponent", [2.0, 1.0, 0.5, 0.0])
def test_powers_with_simple_exponents_are_exact(exponent):
    bases = _RNG.uniform(0, 50, 500)
    assert np.array_equal(exponential.power_each(bases, exponent), bases**exponent)


def test_error_of_a_power_grows_with_its_logarithm():
    bases, exponents = _RNG.uniform(1e-3, 50, 2000), _RNG.uniform(-5, 5, 2000)
    errors = _units(exponential.power_each(bases, exponents), mpmath.power, bases, exponents)
    assert np.all(errors < 2 + 3 * np.abs(exponents * np.log(bases)))


@pytest.mark.parametrize(
    ("name", "x", "value"),
    [
        ("exp", math.inf, math.inf),
        ("exp", 710.0, math.inf),
        ("exp", -math.inf, 0.0),
        ("exp", -746.0, 0.0),
        ("exp", -744.0, 5e-324 * round(math.exp(-744.0) / 5e-324)),
        ("exp", 0.0, 1.0),
        ("log", 0.0, -math.inf),
        ("log", math.inf, math.inf),
        ("log", 1.0, 0.0),
    ],
)
def test_ends_of_the_range_are_those_of_the_real_line(name, x, value):
    assert getattr(exponential, name)(x) == value


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        *((function, [math.nan]) for function in (exponential.exp, exponential.log, trigonometry.sin)),
        *((exponential.log, [-1.0]), (trigonometry.sin, [1e30]), (trigonometry.cos, [-1e18])),
        *(
            (trigonometry.arctan2, yx)
            for yx in ((1.0, math.inf), (math.inf, math.inf), (math.nan, 1.0), (-math.inf, 0.0))
        ),
    ],
)
def test_values_outside_the_domain_are_nan(function, arguments):
    assert math.isnan(function(*arguments))
