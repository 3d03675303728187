"""Poisson random numbers with the same bits on every processor."""

import math

import numpy as np

from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp, log

_LARGE = 10.0  # mean from which on rejection is faster than multiplication


def draw_poisson(rng: np.random.Generator, mean: float) -> int:
    """Draw the same Poisson number as `rng.poisson`, but without the C library's logarithm."""
    if mean <= 0.0:
        return 0
    if mean >= _LARGE:
        return _draw_by_rejection(rng, mean)
    # Count how many uniform numbers can be multiplied before the product falls to exp(-mean).
    least, count, product = exp(-mean), 0, rng.random()
    while product > least:
        count, product = count + 1, product * rng.random()
    return count


def _draw_by_rejection(rng: np.random.Generator, mean: float) -> int:
    """Draw by transformed rejection with squeeze.

    Source: W. Hörmann, The transformed rejection method for generating Poisson random variables, Insurance:
    Mathematics and Economics 12, 1993, algorithm PTRS.
    """
    b = 0.931 + 2.53 * math.sqrt(mean)
    a = -0.059 + 0.02483 * b
    scale, squeeze = 1.1239 + 1.1328 / (b - 3.4), 0.9277 - 3.6224 / (b - 2.0)
    while True:
        u, v = rng.random() - 0.5, rng.random()
        edge = 0.5 - abs(u)
        count = math.floor((2.0 * a / edge + b) * u + mean + 0.43)
        if edge >= 0.07 and v <= squeeze:
            return count
        if count < 0 or (edge < 0.013 and v > edge):
            continue
        density = count * log(mean) - mean - _log_factorial(count)
        if log(v) + log(scale) - log(a / (edge * edge) + b) <= density:
            return count


@compiled
def _log_factorial(n: int) -> float:
    total = 0.0
    for k in range(2, n + 1):
        total += log(float(k))
    return total
