"""Consistency of beliefs: normalised estimation error squared (NEES)."""


def nees_interval(count: int, dof: int) -> tuple[float, float]:
    """95 % interval of the mean NEES of `count` errors of `dof` dimensions for consistent beliefs.

    The NEES of an error e with covariance P is e' P^-1 e (`numerics.distances.squared_distance`). For a consistent
    Gaussian belief it is chi-square distributed with `dof` degrees of freedom, so its mean is `dof`.
    The errors must be independent, as those of different seeds are. Errors of one track at successive scans, and of
    UAVs that share measurements, are dependent: their mean varies more than the interval.
    Source: [BarShalom11].
    """
    if count < 1 or dof < 1:
        raise ValueError(f"count and dof must be at least 1, are {count} and {dof}")
    from scipy.special import gammaincinv

    # Quantiles of the chi-square distribution; `scipy.stats` has them, too, but takes half a second to import.
    low, high = 2.0 * gammaincinv(count * dof / 2, [(1 - 0.95) / 2, (1 + 0.95) / 2]) / count
    return float(low), float(high)
