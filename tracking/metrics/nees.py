"""Whether beliefs are as sure as they are right."""

from __future__ import annotations

from scipy.stats import chi2

from tracking.numerics.compiled import Array
from tracking.numerics.matrices import squared_distance


def nees(errors: Array, covariances: Array) -> Array:
    """Normalised estimation error squared (...): e' P^-1 e of errors e (..., d) with covariances P (..., d, d).

    Of a consistent Gaussian belief it is chi-square with d degrees of freedom, so d on average.
    Source: [BarShalom11].
    """
    return squared_distance(errors, covariances)


def nees_interval(count: int, dof: int, probability: float = 0.95) -> tuple[float, float]:
    """Where the mean NEES of `count` errors of `dof` dimensions is with the given probability, if beliefs are right.

    It assumes that the errors are independent of one another. Those of one track at successive scans, and those of UAVs
    that share what they see, are not: their mean varies more than the interval says. Errors of different seeds are.
    Source: [BarShalom11].
    """
    if count < 1 or dof < 1 or not 0 < probability < 1:
        raise ValueError(
            f"count and dof must be at least 1, probability in (0, 1); are {count}, {dof} and {probability}"
        )
    low, high = chi2.ppf([(1 - probability) / 2, (1 + probability) / 2], count * dof) / count
    return float(low), float(high)
