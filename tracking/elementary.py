"""Elementary functions with the same bits on every processor.

The C library and NumPy choose their code by processor, and results differ in the last bit. These use additions,
multiplications, divisions and square roots alone, which IEEE 754 rounds in one way, in an order that is written down.
Each is within two units in the last place of the true value unless its docstring says otherwise
(tests/test_elementary.py). Those whose names end in `_each` take arrays and broadcast as NumPy does.
"""

from __future__ import annotations

import math

import numpy as np

from tracking.compiled import Array, compiled, elementwise

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
_SIN = tuple((-1.0) ** (k // 2) / math.factorial(k) for k in range(19, 1, -2))
_COS = tuple((-1.0) ** (k // 2) / math.factorial(k) for k in range(20, 2, -2))
_ARCTAN = tuple((-1.0) ** (k // 2) / k for k in range(13, 1, -2))


@compiled
def _polynomial(coefficients: tuple[float, ...], x: float) -> float:
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
    value = 1.0 + (r + r * r * _polynomial(_EXP, r))
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
    return float(k * _LN2_HIGH - ((half - (s * (half + square * _polynomial(_LOG, square)) + k * _LN2_LOW)) - f))


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
    k = math.floor(x / _HALF_PI[0] + 0.5)
    r = ((x - k * _HALF_PI[0]) - k * _HALF_PI[1]) - k * _HALF_PI[2]
    return r - k * _HALF_PI[3], int(k % 4.0)


@compiled
def _sine(r: float) -> float:
    """Sine of |r| <= π/4."""
    return r + r * (r * r * _polynomial(_SIN, r * r))


@compiled
def _cosine(r: float) -> float:
    """Cosine of |r| <= π/4."""
    s = r * r
    near = 1.0 - 0.5 * s
    return near + (((1.0 - near) - 0.5 * s) + s * s * _polynomial(_COS, s))


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
    """Angle [rad], in [-π, π], of the direction (x, y); 0 of none."""
    a, b = abs(x), abs(y)
    if a == 0.0 and b == 0.0:
        return 0.0
    if math.isnan(a) or math.isnan(b):
        return math.nan
    low, high = min(a, b), max(a, b)
    ratio = low / high
    k = int(16.0 * ratio + 0.5)
    # atan(r) = atan(c) + atan((r - c) / (1 + r c)) about the nearest sixteenth c.
    t = (16.0 * low - k * high) / (16.0 * high + k * low)
    angle = _ARCTANGENTS[k] + (t + t * (t * t * _polynomial(_ARCTAN, t * t)))
    if b > a:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return float(angle if y >= 0.0 else -angle)


@compiled
def hypot(x: float, y: float) -> float:
    """Length of (x, y); both below 1e150 in size."""
    return math.sqrt(x * x + y * y)


# Hart's rational approximation as given by West (2005), numerator and denominator, highest power first.
_TAIL = (
    (
        3.52624965998911e-02,
        0.700383064443688,
        6.37396220353165,
        33.912866078383,
        112.079291497871,
        221.213596169931,
        220.206867912376,
    ),
    (
        8.83883476483184e-02,
        1.75566716318264,
        16.064177579207,
        86.7807322029461,
        296.564248779674,
        637.333633378831,
        793.826512519948,
        440.413735824752,
    ),
)


@compiled
def normal_cdf(x: float) -> float:
    """Probability that a standard normal variable is below x, to an absolute error of 1e-15.

    Source: G. West, Better approximations to cumulative normal functions, Wilmott, 2005.
    """
    z = abs(x)
    if z < 7.07106781186547:
        tail = exp(-0.5 * z * z) * _polynomial(_TAIL[0], z) / _polynomial(_TAIL[1], z)
    else:
        tail = exp(-0.5 * z * z) / (z + 1.0 / (z + 2.0 / (z + 3.0 / (z + 4.0 / (z + 0.65))))) / 2.506628274631
    return 1.0 - tail if x > 0.0 else tail


# Numerators and denominators near the middle, and in the nearer and farther tails, highest power first.
_CENTRAL = (
    (
        2.5090809287301226727e3,
        3.3430575583588128105e4,
        6.7265770927008700853e4,
        4.5921953931549871457e4,
        1.3731693765509461125e4,
        1.9715909503065514427e3,
        1.3314166789178437745e2,
        3.3871328727963666080e0,
    ),
    (
        5.2264952788528545610e3,
        2.8729085735721942674e4,
        3.9307895800092710610e4,
        2.1213794301586595867e4,
        5.3941960214247511077e3,
        6.8718700749205790830e2,
        4.2313330701600911252e1,
        1.0,
    ),
)
_NEARER = (
    (
        7.74545014278341407640e-4,
        2.27238449892691845833e-2,
        2.41780725177450611770e-1,
        1.27045825245236838258e0,
        3.64784832476320460504e0,
        5.76949722146069140550e0,
        4.63033784615654529590e0,
        1.42343711074968357734e0,
    ),
    (
        1.05075007164441684324e-9,
        5.47593808499534494600e-4,
        1.51986665636164571966e-2,
        1.48103976427480074590e-1,
        6.89767334985100004550e-1,
        1.67638483018380384940e0,
        2.05319162663775882187e0,
        1.0,
    ),
)
_FARTHER = (
    (
        2.01033439929228813265e-7,
        2.71155556874348757815e-5,
        1.24266094738807843860e-3,
        2.65321895265761230930e-2,
        2.96560571828504891230e-1,
        1.78482653991729133580e0,
        5.46378491116411436990e0,
        6.65790464350110377720e0,
    ),
    (
        2.04426310338993978564e-15,
        1.42151175831644588870e-7,
        1.84631831751005468180e-5,
        7.86869131145613259100e-4,
        1.48753612908506148525e-2,
        1.36929880922735805310e-1,
        5.99832206555887937690e-1,
        1.0,
    ),
)


@compiled
def normal_quantile(p: float) -> float:
    """The x below which a standard normal variable is with probability p in (0, 1), to a relative error of 1e-15.

    Source: M. J. Wichura, Algorithm AS 241, Applied Statistics 37, 1988.
    """
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        return q * _polynomial(_CENTRAL[0], r) / _polynomial(_CENTRAL[1], r)
    r = math.sqrt(-log(min(p, 1.0 - p)))
    if r <= 5.0:
        x = _polynomial(_NEARER[0], r - 1.6) / _polynomial(_NEARER[1], r - 1.6)
    else:
        x = _polynomial(_FARTHER[0], r - 5.0) / _polynomial(_FARTHER[1], r - 5.0)
    return -x if q < 0.0 else x


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
def normal_cdf_each(x: float) -> float:
    """`normal_cdf` of each element."""
    return normal_cdf(x)


@elementwise
def normal_quantile_each(p: float) -> float:
    """`normal_quantile` of each element."""
    return normal_quantile(p)


@elementwise
def arctan2_each(y: float, x: float) -> float:
    """`arctan2` of each element."""
    return arctan2(y, x)


@elementwise
def power_each(x: float, y: float) -> float:
    """`power` of each element."""
    return power(x, y)


def standard_normal(rng: np.random.Generator, shape: int | tuple[int, ...]) -> Array:
    """Draw standard normal numbers by inversion of their distribution; NumPy's own call the C library's logarithm."""
    return np.asarray(normal_quantile_each(np.maximum(rng.random(shape), 2.0**-54)))
