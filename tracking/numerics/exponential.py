"""Exponential, logarithm and power with the same bits on every processor.

The C library and NumPy choose their code by processor, and results differ in the last bit. The elementary functions of
this folder use only operations that IEEE 754 rounds in one way, in an order that is written down. Each is within two
units in the last place of the true value unless its docstring says otherwise.
"""

import math

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.stacks import elementwise

_LOG2E = 1.4426950408889634
# ln 2 as a sum. The first part has so few bits that its products with small integers are exact.
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_ROOT_HALF = int(np.array([math.sqrt(0.5)]).view(np.int64)[0])  # bits of 1/√2
# Coefficients of Taylor series, that of the highest power first.
_EXP = tuple(1.0 / math.factorial(k) for k in range(13, 1, -1))
_LOG = tuple(2.0 / k for k in range(25, 1, -2))


@compiled
def polynomial(coefficients: tuple[float, ...], x: float) -> float:
    """Value at x of a polynomial, its highest power's coefficient first."""
    value = 0.0
    for coefficient in coefficients:
        value = value * x + coefficient
    return value


@inlined
def _power_of_two(k: int) -> float:
    """2^k for k from -1022 to 1023, by its bits."""
    return np.int64((k + 1023) << 52).view(np.float64)


@inlined
def exp(x: float) -> float:
    """Exponential of x, by its Taylor series about the nearest multiple of ln 2; loops over it can be vectorised."""
    inside = -745.2 < x < 709.79
    safe = x if inside else 0.0
    nearest = np.floor(safe * _LOG2E + 0.5)
    r = (safe - nearest * _LN2_HIGH) - nearest * _LN2_LOW
    value = 1.0 + (r + r * r * polynomial(_EXP, r))
    k = int(np.int32(nearest))  # processors convert to 32 bits side by side
    half = k >> 1  # in two factors, as the power of two itself may be out of range
    value *= _power_of_two(half) * _power_of_two(k - half)
    outside = x if math.isnan(x) else (0.0 if x < 0.0 else math.inf)
    return float(value if inside else outside)


@inlined
def _log(f: float, k: int) -> float:
    """Natural logarithm of (1 + f) 2^k, with 1 + f in [1/√2, √2).

    log((1 + s) / (1 - s)) = 2 s + s (2/3 s² + 2/5 s⁴ + ...), with 2 s = f - f²/2 + s f²/2.
    """
    s = f / (2.0 + f)
    square, half = s * s, 0.5 * f * f
    return k * _LN2_HIGH - ((half - (s * (half + square * polynomial(_LOG, square)) + k * _LN2_LOW)) - f)


@compiled
def log(x: float) -> float:
    """Natural logarithm of x: NaN below zero, -inf at zero."""
    if not 0.0 < x < math.inf:
        return -math.inf if x == 0.0 else (x if x > 0.0 else math.nan)
    mantissa, k = math.frexp(x)
    if mantissa < math.sqrt(0.5):
        mantissa, k = 2.0 * mantissa, k - 1
    return float(_log(mantissa - 1.0, k))


@compiled
def replace_by_logs(x: Array) -> None:
    """Replace normal positive numbers (N,) by their natural logarithms, side by side; `log` takes them one by one."""
    bits = x.view(np.int64)
    for i in range(len(x)):
        # Write x as m 2^k with m in [1/√2, √2): k is the exponent of x / (1/√2), read from the difference of bits.
        k = (bits[i] - _ROOT_HALF) >> 52
        bits[i] -= k << 52
        x[i] = _log(x[i] - 1.0, k)


@compiled
def power(x: float, y: float) -> float:
    """The y-th power of x >= 0; exact for y of 0, 1/2, 1 and 2, else the error is up to 2 + 3 |y log x| units."""
    if y == 2.0:
        return x * x
    if y == 1.0:
        return x
    if y == 0.5:
        return math.sqrt(x)
    return exp(y * log(x)) if y != 0.0 else 1.0


@elementwise
@compiled
def exp_each(x: Array) -> Array:
    """Exponentials of an array."""
    out = np.empty(len(x))
    for k in range(len(x)):
        out[k] = exp(x[k])
    return out


@elementwise
@compiled
def power_each(x: Array, y: Array) -> Array:
    """Powers of arrays that broadcast."""
    out = np.empty(len(x))
    for k in range(len(x)):
        out[k] = power(x[k], y[k])
    return out
