"""Consistency of beliefs: normalised estimation error squared (NEES)."""

from scipy.special import gammaincinv


def nees_interval(count: int, dof: int) -> tuple[float, float]:
    """Interval of the mean NEES of `count` errors of `dof` dimensions for consistent beliefs, with 95 %.

    The NEES of an error e with covariance P is e' P^-1 e, as `numerics.distances.squared_distance` has it. For a
    consistent Gaussian belief it is chi-square distributed with `dof` degrees of freedom, so `dof` on average.
    The errors must be independent of one another, as those of different seeds are. Errors of one track at successive
    scans, and of UAVs that share measurements, are not: their mean varies more than the interval.
    Source: [BarShalom11].
    """
    if count < 1 or dof < 1:
        raise ValueError(f"count and dof must be at least 1, are {count} and {dof}")
    # Quantiles of the chi-square distribution; `scipy.stats` has them, too, but takes half a second to import.
    low, high = 2.0 * gammaincinv(count * dof / 2, [(1 - 0.95) / 2, (1 + 0.95) / 2]) / count
    return float(low), float(high)
