"""Elementary functions with the same bits on every processor.

The C library and NumPy choose their code by processor, and results differ in the last bit. These use additions,
multiplications, divisions and square roots alone, which IEEE 754 rounds in one way, in an order that is written down.
Each is within two units in the last place of the true value unless its docstring says otherwise
(tests/tracking/numerics/test_elementary.py). Those whose names end in `_each` take arrays and broadcast as NumPy does.
"""

from __future__ import annotations

import math

import numpy as np

from tracking.numerics.compiled import compiled, elementwise

_LOG2E = 1.4426950408889634
# ln 2 and π/2 as sums whose first parts have so few bits that their products with small integers are exact.
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_HALF_PI = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624871116645580e-21, 8.47842766036889956997e-32)
_POWERS_OF_TWO = np.array([math.ldexp(1.0, k) for k in range(-1074, 1024)])
_ARCTANGENTS = np.array(  # of 0, 1/16, ... 1
    [
        *(0.0, 0.06241880999595735, 0.12435499454676144, 0.18534794999569476, 0.24497866312686414, 0.3028848683749714),
        *(0.35877067027057225, 0.4124104415973873, 0.4636476090008061, 0.5123894603107377, 0.5585993153435624),
        *(0.6022873461349642, 0.6435011087932844, 0.6823165548747481, 0.7188299996216245, 0.7531512809621944),
        0.7853981633974483,
    ]
)
# Coefficients of Taylor series, that of the highest power first.
_EXP = tuple(1.0 / math.factorial(k) for k in range(13, 1, -1))
_LOG = tuple(2.0 / k for k in range(25, 1, -2))
_SIN = tuple((1 - k // 2 % 2 * 2) / math.factorial(k) for k in range(19, 1, -2))
_COS = tuple((1 - k // 2 % 2 * 2) / math.factorial(k) for k in range(20, 2, -2))
_ARCTAN = tuple((1 - k // 2 % 2 * 2) / k for k in range(13, 1, -2))


@compiled
def polynomial(coefficients: tuple[float, ...], x: float) -> float:
    """Value at x of a polynomial, its highest power's coefficient first."""
    value = 0.0
    for coefficient in coefficients:
        value = value * x + coefficient
    return value


@compiled
def exp(x: float) -> float:
    """Exponential of x, by its Taylor series about the nearest multiple of ln 2."""
    inside = -745.2 < x < 709.79
    safe = x if inside else 0.0  # compiled code may work out both branches, which must not raise flags
    k = math.floor(safe * _LOG2E + 0.5)
    r = (safe - k * _LN2_HIGH) - k * _LN2_LOW
    value = 1.0 + (r + r * r * polynomial(_EXP, r))
    half = k // 2  # in two factors, as the power of two itself may be out of range
    value *= _POWERS_OF_TWO[half + 1074] * _POWERS_OF_TWO[k - half + 1074]
    if inside:
        return float(value)
    return x if math.isnan(x) else (0.0 if x < 0.0 else math.inf)


@compiled
def log(x: float) -> float:
    """Natural logarithm of x: NaN below zero, -inf at zero."""
    if not 0.0 < x < math.inf:
        return -math.inf if x == 0.0 else (x if x > 0.0 else math.nan)
    mantissa, k = math.frexp(x)
    if mantissa < math.sqrt(0.5):
        mantissa, k = 2.0 * mantissa, k - 1
    f = mantissa - 1.0
    s = f / (2.0 + f)
    square = s * s
    # log((1 + s) / (1 - s)) = 2 s + s (2/3 s² + 2/5 s⁴ + ...), with 2 s = f - f²/2 + s f²/2.
    half = 0.5 * f * f
    return float(k * _LN2_HIGH - ((half - (s * (half + square * polynomial(_LOG, square)) + k * _LN2_LOW)) - f))


@compiled
def power(x: float, y: float) -> float:
    """X to the y of x >= 0; exact for y of 0, 1 and 2, else the error is up to 2 + 3 |y log x| units."""
    if y == 2.0:
        return x * x
    if y == 1.0:
        return x
    if y == 0.5:
        return math.sqrt(x)
    return exp(y * log(x)) if y != 0.0 else 1.0


@compiled
def _reduced(x: float) -> tuple[float, int]:
    """The angle x [rad] less the nearest multiple of π/2, and which multiple that is, modulo 4."""
    x = x if abs(x) < 1e15 else math.nan  # of which no digit of the angle is left
    k = math.floor(x / _HALF_PI[0] + 0.5)
    r = ((x - k * _HALF_PI[0]) - k * _HALF_PI[1]) - k * _HALF_PI[2]
    return r - k * _HALF_PI[3], int(k % 4.0)


@compiled
def _sine(r: float) -> float:
    """Sine of |r| <= π/4."""
    return r + r * (r * r * polynomial(_SIN, r * r))


@compiled
def _cosine(r: float) -> float:
    """Cosine of |r| <= π/4."""
    s = r * r
    near = 1.0 - 0.5 * s
    return near + (((1.0 - near) - 0.5 * s) + s * s * polynomial(_COS, s))


@compiled
def sin(x: float) -> float:
    """Sine of an angle [rad], to an absolute error of 3e-16 up to |x| of 1e5."""
    r, quarter = _reduced(x)
    value = _sine(r) if quarter % 2 == 0 else _cosine(r)
    return value if quarter < 2 else -value


@compiled
def cos(x: float) -> float:
    """Cosine of an angle [rad], to an absolute error of 3e-16 up to |x| of 1e5."""
    r, quarter = _reduced(x)
    value = _cosine(r) if quarter % 2 == 0 else _sine(r)
    return -value if quarter in (1, 2) else value


@compiled
def tan(x: float) -> float:
    """Tangent of an angle [rad], to a relative error of 1e-15 within |x| <= 1.5."""
    return sin(x) / cos(x)


@compiled
def arctan2(y: float, x: float) -> float:
    """Angle [rad], in [-π, π], of the direction (x, y); 0 of none, NaN of one that is not finite."""
    a, b = abs(x), abs(y)
    if a == 0.0 and b == 0.0:
        return 0.0
    if not a + b < math.inf:
        return math.nan
    low, high = min(a, b), max(a, b)
    ratio = low / high
    k = int(16.0 * ratio + 0.5)
    # atan(r) = atan(c) + atan((r - c) / (1 + r c)) about the nearest sixteenth c.
    t = (16.0 * low - k * high) / (16.0 * high + k * low)
    angle = _ARCTANGENTS[k] + (t + t * (t * t * polynomial(_ARCTAN, t * t)))
    if b > a:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return float(angle if y >= 0.0 else -angle)


@compiled
def hypot(x: float, y: float) -> float:
    """Length of (x, y); both below 1e150 in size."""
    return math.sqrt(x * x + y * y)


@elementwise
def exp_each(x: float) -> float:
    """`exp` of each element."""
    return exp(x)


@elementwise
def log_each(x: float) -> float:
    """`log` of each element."""
    return log(x)


@elementwise
def sin_each(x: float) -> float:
    """`sin` of each element."""
    return sin(x)


@elementwise
def cos_each(x: float) -> float:
    """`cos` of each element."""
    return cos(x)


@elementwise
def arctan2_each(y: float, x: float) -> float:
    """`arctan2` of each element."""
    return arctan2(y, x)


@elementwise
def power_each(x: float, y: float) -> float:
    """`power` of each element."""
    return power(x, y)
