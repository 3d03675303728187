"""The normal distribution with the same bits on every processor: probabilities, quantiles and random numbers."""

import math

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.exponential import exp, log, polynomial
from tracking.numerics.stacks import elementwise

_MIDDLE = 0.425  # distance from one half
_LEAST = 0.5 / (1 << 53)  # half the step between uniform random numbers
# fmt: off
# Hart's rational approximation as given by West (2005), numerator and denominator, highest power first.
_TAIL = (
    (3.52624965998911e-02, 0.700383064443688, 6.37396220353165, 33.912866078383, 112.079291497871, 221.213596169931,
     220.206867912376),
    (8.83883476483184e-02, 1.75566716318264, 16.064177579207, 86.7807322029461, 296.564248779674, 637.333633378831,
     793.826512519948, 440.413735824752),
)
# Numerators and denominators near the middle, and in the nearer and farther tails, highest power first.
_CENTRAL = (
    (2.5090809287301226727e3, 3.3430575583588128105e4, 6.7265770927008700853e4, 4.5921953931549871457e4,
     1.3731693765509461125e4, 1.9715909503065514427e3, 1.3314166789178437745e2, 3.3871328727963666080e0),
    (5.2264952788528545610e3, 2.8729085735721942674e4, 3.9307895800092710610e4, 2.1213794301586595867e4,
     5.3941960214247511077e3, 6.8718700749205790830e2, 4.2313330701600911252e1, 1.0),
)
_NEARER = (
    (7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1, 1.27045825245236838258e0,
     3.64784832476320460504e0, 5.76949722146069140550e0, 4.63033784615654529590e0, 1.42343711074968357734e0),
    (1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2, 1.48103976427480074590e-1,
     6.89767334985100004550e-1, 1.67638483018380384940e0, 2.05319162663775882187e0, 1.0),
)
_FARTHER = (
    (2.01033439929228813265e-7, 2.71155556874348757815e-5, 1.24266094738807843860e-3, 2.65321895265761230930e-2,
     2.96560571828504891230e-1, 1.78482653991729133580e0, 5.46378491116411436990e0, 6.65790464350110377720e0),
    (2.04426310338993978564e-15, 1.42151175831644588870e-7, 1.84631831751005468180e-5, 7.86869131145613259100e-4,
     1.48753612908506148525e-2, 1.36929880922735805310e-1, 5.99832206555887937690e-1, 1.0),
)
# fmt: on


@inlined
def normal_cdf(x: float) -> float:
    """As `normal_cdf_each`, of one number."""
    z = abs(x)
    if z < 7.07106781186547:
        tail = exp(-0.5 * z * z) * polynomial(_TAIL[0], z) / polynomial(_TAIL[1], z)
    else:
        tail = exp(-0.5 * z * z) / (z + 1.0 / (z + 2.0 / (z + 3.0 / (z + 4.0 / (z + 0.65))))) / 2.506628274631
    return 1.0 - tail if x > 0.0 else tail


@inlined
def rough_normal_cdf(x: float) -> float:
    """As `normal_cdf_each`, of one number, to an absolute error of 2.5e-4, in a quarter of the time.

    Source: M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions, 1964, 26.2.18.
    """
    z = abs(x)
    root = 1.0 + z * (0.196854 + z * (0.115194 + z * (0.000344 + z * 0.019527)))
    square = root * root
    tail = 0.5 / (square * square)
    return 1.0 - tail if x > 0.0 else tail


@elementwise
@compiled
def normal_cdf_each(x: Array) -> Array:
    """Probability that a standard normal variable is below each x, to an absolute error of 1e-15.

    Source: G. West, Better approximations to cumulative normal functions, Wilmott, 2005.
    """
    out = np.empty(len(x))
    for k in range(len(x)):
        out[k] = normal_cdf(x[k])
    return out


def standard_normal(rng: np.random.Generator, shape: int | tuple[int, ...]) -> Array:
    """Draw standard normal numbers by inversion; NumPy's generator calls the C library's logarithm."""
    uniform = rng.random(shape)
    return normal_quantiles(np.maximum(uniform.ravel(), _LEAST)).reshape(uniform.shape)


@compiled
def normal_quantiles(p: Array) -> Array:
    """Quantiles of the standard normal distribution at p (N,) in (0, 1), to a relative error of 1e-15.

    Source: M. J. Wichura, Algorithm AS 241, Applied Statistics 37, 1988.
    """
    out = np.empty(len(p))
    for k in range(len(p)):  # a vectorised loop without branches, which is correct in the middle, where most p are
        q = p[k] - 0.5
        r = 0.180625 - q * q
        out[k] = q * polynomial(_CENTRAL[0], r) / polynomial(_CENTRAL[1], r)
    for k in range(len(p)):
        if abs(p[k] - 0.5) > _MIDDLE:
            out[k] = _tail_quantile(p[k])
    return out


@compiled
def _tail_quantile(p: float) -> float:
    """Quantile at p more than `_MIDDLE` from one half."""
    r = math.sqrt(-log(min(p, 1.0 - p)))
    if r <= 5.0:
        x = polynomial(_NEARER[0], r - 1.6) / polynomial(_NEARER[1], r - 1.6)
    else:
        x = polynomial(_FARTHER[0], r - 5.0) / polynomial(_FARTHER[1], r - 5.0)
    return -x if p < 0.5 else x
