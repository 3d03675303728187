"""Spreads of values between and within maps, their empirical distributions, and quartiles over time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.numerics.arrays import Array


@dataclass(frozen=True)
class Spread:
    """Standard deviations: between the expected values of maps, and within maps, between the repeats of a map."""

    between: float = np.nan
    within: float = np.nan


NO_SPREAD = Spread()


def spreads(values: Array, maps: NDArray[np.object_]) -> list[Spread]:
    """Variance components, as standard deviations, of each column of values (N, M) of trials on `maps` (N,).

    Estimates are those of the one-way random effects analysis of variance, also for unequal numbers of repeats. NaN and
    infinity are left out, and a negative estimate becomes zero. Both are NaN if no map has repeats.
    Source: S. R. Searle, G. Casella and C. E. McCulloch, Variance Components, 1992, section 3.6.
    """
    found = np.isfinite(values)
    return [_spread(column[kept], maps[kept]) for column, kept in zip(values.T, found.T, strict=True)]


def _spread(values: Array, maps: NDArray[np.object_]) -> Spread:
    _, place, counts = np.unique(maps, return_inverse=True, return_counts=True)
    trials, number = len(values), len(counts)
    if trials == number:
        return NO_SPREAD
    own = np.bincount(place, values) / counts
    within = float(np.sum((values - own[place]) ** 2)) / (trials - number)
    if number < 2:
        return Spread(np.nan, float(np.sqrt(within)))
    among = float(np.sum(counts * (own - values.mean()) ** 2)) / (number - 1)
    size = (trials - float(np.sum(counts**2)) / trials) / (number - 1)
    return Spread(float(np.sqrt(max(0.0, (among - within) / size))), float(np.sqrt(within)))


def ecdf(values: Array, at: Array) -> Array:
    """Share of the values (N,) that are no more than each of `at`; NaN is left out, and no values give NaN."""
    ordered = np.sort(values[~np.isnan(values)])
    if not len(ordered):
        return np.full(len(at), np.nan)
    shares: Array = np.searchsorted(ordered, at, side="right") / len(ordered)
    return shares


def share_under(values: Array, bound: float) -> float:
    """Share of the values (N,) that are below a bound; NaN is left out."""
    counted = values[~np.isnan(values)]
    return float(np.mean(counted < bound)) if len(counted) else np.nan


def bands(curves: Array) -> Array:
    """Lower quartile, median and upper quartile (3, T) of curves (n, T) at each scan; NaN is left out."""
    found = np.full((3, curves.shape[1]), np.nan)
    held = ~np.isnan(curves).all(axis=0)
    found[:, held] = np.nanquantile(curves[:, held], [0.25, 0.5, 0.75], axis=0)
    return found
