"""Trigonometric functions and the length of a vector of the plane; method and errors as in `exponential`."""

import math

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import polynomial
from tracking.numerics.stacks import elementwise

# π/2 as a sum. The first parts have so few bits that their products with small integers are exact.
_HALF_PI = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624871116645580e-21, 8.47842766036889956997e-32)
_ARCTANGENTS = np.array(  # of 0, 1/16, ... 1
    [
        *(0.0, 0.06241880999595735, 0.12435499454676144, 0.18534794999569476, 0.24497866312686414, 0.3028848683749714),
        *(0.35877067027057225, 0.4124104415973873, 0.4636476090008061, 0.5123894603107377, 0.5585993153435624),
        *(0.6022873461349642, 0.6435011087932844, 0.6823165548747481, 0.7188299996216245, 0.7531512809621944),
        0.7853981633974483,
    ]
)
# Coefficients of Taylor series, that of the highest power first.
_SIN = tuple((1 - k // 2 % 2 * 2) / math.factorial(k) for k in range(19, 1, -2))
_COS = tuple((1 - k // 2 % 2 * 2) / math.factorial(k) for k in range(20, 2, -2))
_ARCTAN = tuple((1 - k // 2 % 2 * 2) / k for k in range(13, 1, -2))


@compiled
def _reduce(x: float) -> tuple[float, int]:
    """Remainder of an angle x [rad] from the nearest multiple of π/2, and that multiple modulo 4."""
    x = x if abs(x) < 1e15 else math.nan  # beyond, no digit of the angle is left
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
    r, quarter = _reduce(x)
    value = _sine(r) if quarter % 2 == 0 else _cosine(r)
    return value if quarter < 2 else -value


@compiled
def cos(x: float) -> float:
    """Cosine of an angle [rad], to an absolute error of 3e-16 up to |x| of 1e5."""
    r, quarter = _reduce(x)
    value = _cosine(r) if quarter % 2 == 0 else _sine(r)
    return -value if quarter in (1, 2) else value


@compiled
def tan(x: float) -> float:
    """Tangent of an angle [rad], to a relative error of 1e-15 within |x| <= 1.5."""
    return sin(x) / cos(x)


@compiled
def arctan2(y: float, x: float) -> float:
    """Angle [rad], in [-π, π], of the direction (x, y); 0 for (0, 0), NaN for directions that are not finite."""
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
@compiled
def sin_each(x: Array) -> Array:
    """Sines of an array."""
    out = np.empty(len(x))
    for k in range(len(x)):
        out[k] = sin(x[k])
    return out


@elementwise
@compiled
def cos_each(x: Array) -> Array:
    """Cosines of an array."""
    out = np.empty(len(x))
    for k in range(len(x)):
        out[k] = cos(x[k])
    return out


@elementwise
@compiled
def arctan2_each(y: Array, x: Array) -> Array:
    """Directions [rad] of (x, y), arrays that broadcast."""
    out = np.empty(len(y))
    for k in range(len(x)):
        out[k] = arctan2(y[k], x[k])
    return out
