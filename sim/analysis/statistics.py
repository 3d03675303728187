"""Means and medians over maps with their intervals, tests, spreads, empirical distributions, and bands over time.

Maps are what is sampled: a map's value is the mean over its repeats. Intervals are of 95 %, each for itself: of twenty
comparisons, one is expected to miss.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import nctdtr, stdtr, stdtrit
from scipy.stats import binom

from tracking.numerics.arrays import Array

LEVEL = 0.95
POWER = 0.8  # with which `maps_needed` finds a difference
MOST_MAPS = 9999  # beyond which no number is told


@dataclass(frozen=True)
class Estimate:
    """A value with its interval; NaN where there is none."""

    value: float = np.nan
    low: float = np.nan
    high: float = np.nan


@dataclass(frozen=True)
class Spread:
    """Standard deviations: between maps, of what a map is worth, and within maps, of the repeats of one."""

    between: float = np.nan
    within: float = np.nan


NO_ESTIMATE = Estimate()
NO_SPREAD = Spread()


def means(values: Array) -> list[Estimate]:
    """The mean of each column of values (n, M) with its interval; NaN and infinity are left out.

    Student's t interval, with the end on the side of the longer tail moved outwards by the Edgeworth term of the
    sample's skewness γ, γ s (1 + 2 t²) / 6n; the other end stays. A column whose values are all equal has an interval
    of no width, one of a single value has none.

    Of 8, 10, 20 and 50 maps drawn from trials that were flown, these intervals held the mean share of scans under 1 m
    in 94, 93, 94 and 95 % of cases at least, Student's in 89, 89, 91 and 94 %, bootstraps of BCa kind in 80, 83, 86 and
    90 %; `sim.analysis.coverage` has mean errors.
    Source: N. J. Johnson, Modified t tests and confidence intervals for asymmetrical populations, JASA, 1978; P. Hall,
    On the removal of skewness by transformation, JRSS B, 1992.
    """
    return _by_column(values, _means)


def medians(values: Array) -> list[Estimate]:
    """The median of each column of values (n, M) with its interval; NaN and infinity are left out.

    The interval ends at two of the values, of equal rank from below and from above: the innermost that hold the median
    of any distribution with 95 % at least. Of fewer than six values these are the least and the greatest, which hold
    it with 1 - 2 / 2ⁿ.
    """
    return _by_column(values, _medians)


def chances(values: Array) -> list[float]:
    """For each column of differences (n, M) the p-value of no difference in the mean; 1 where nothing is known.

    The interval of `means` at the level 1 - p ends at zero, so p is below 5 % where that of 95 % leaves zero out. It
    is never below 2 / 2ⁿ, the least that n maps can give a test without assumptions on the distribution; so nothing
    is told apart on fewer than six.
    """
    found = np.isfinite(values)
    return [_chance(column[kept]) for column, kept in zip(values.T, found.T, strict=True)]


def holm(chances: Sequence[float]) -> list[bool]:
    """Marks of the p-values that stay below 5 % when all are judged together.

    Source: S. Holm, A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics, 1979.
    """
    order = np.argsort(chances, kind="stable")
    adjusted = np.array(chances)[order] * np.arange(len(chances), 0, -1)
    kept = np.zeros(len(chances), dtype=bool)
    kept[order] = np.maximum.accumulate(adjusted) <= 1 - LEVEL
    return kept.tolist()


def spreads(values: Array, maps: NDArray[np.object_]) -> list[Spread]:
    """Of each column of values (N, M) of trials on `maps` (N,) its variance components, as standard deviations.

    Estimates of the one-way random effects analysis of variance, for unequal numbers of repeats too; NaN and infinity
    are left out. A variance that comes out negative is zero. Without a map that has repeats, nothing can be told.
    Source: S. R. Searle, G. Casella and C. E. McCulloch, Variance Components, 1992, section 3.6.
    """
    found = np.isfinite(values)
    return [_spread(column[kept], maps[kept]) for column, kept in zip(values.T, found.T, strict=True)]


def maps_needed(values: Array) -> list[float]:
    """For each column of differences (n, M) the number of maps that would tell it apart from zero; infinity: too many.

    The least number for which a paired t test of 5 %, two-sided, finds a true difference of the mean observed with a
    probability of 80 %, if maps differ by the standard deviation observed; never fewer than six. NaN of fewer than two.
    """
    found = np.isfinite(values)
    return [_needed(column[kept]) for column, kept in zip(values.T, found.T, strict=True)]


def _by_column(values: Array, estimate: Callable[[Array], Estimate]) -> list[Estimate]:
    """Estimates of every column (n,), of its finite values."""
    return [_estimated(column[np.isfinite(column)], estimate) for column in values.T]


def _estimated(values: Array, estimate: Callable[[Array], Estimate]) -> Estimate:
    if len(values) < 2:
        return Estimate(float(values[0])) if len(values) else NO_ESTIMATE
    return estimate(values)


def _moments(values: Array) -> tuple[float, float, float]:
    """Mean, its standard error, and the unit γ s / 6n of the Edgeworth term, of two values or more."""
    n, centre = len(values), float(values.mean())
    if np.ptp(values) == 0:
        return float(values[0]), 0.0, 0.0
    residuals = values - centre
    spread = float(np.sqrt(np.sum(residuals**2) / (n - 1)))
    cubes = float(np.sum((residuals / spread) ** 3))
    skewness = cubes * n / ((n - 1) * (n - 2)) if n > 2 else 0.0
    return centre, spread / float(np.sqrt(n)), skewness * spread / (6 * n)


def _means(values: Array) -> Estimate:
    centre, error, unit = _moments(values)
    quantile = float(stdtrit(len(values) - 1, (1 + LEVEL) / 2))
    reach = unit * (1 + 2 * quantile**2)
    return Estimate(centre, centre - quantile * error + min(reach, 0.0), centre + quantile * error + max(reach, 0.0))


def _medians(values: Array) -> Estimate:
    n, ordered = len(values), np.sort(values)
    rank = _rank(n)
    return Estimate(float(np.median(ordered)), float(ordered[rank - 1]), float(ordered[n - rank]))


@cache
def _rank(n: int) -> int:
    """The greatest rank of n values that the median lies below in 2.5 % of cases at most; the first if none is."""
    return max(1, int(binom.ppf((1 - LEVEL) / 2, n, 0.5)))  # below rank r: of n coins fewer than r show heads


def _chance(values: Array) -> float:
    n = len(values)
    if n < 2:
        return 1.0
    centre, error, unit = _moments(values)
    least = 2.0 ** (1 - n)
    if error == 0.0:
        return least if centre else 1.0
    # The quantile at which the end towards zero is zero: |centre| = q error + reach (1 + 2 q²).
    reach = max(-unit if centre > 0 else unit, 0.0)
    room = abs(centre) - reach
    if room <= 0:
        return 1.0
    quantile = 2 * room / (error + np.sqrt(error**2 + 8 * reach * room))
    return max(least, 2 * float(stdtr(n - 1, -quantile)))


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


def _needed(values: Array) -> float:
    if len(values) < 2:
        return np.nan
    centre, error, _ = _moments(values)
    if centre == 0:
        return np.inf
    effect = abs(centre) / (error * np.sqrt(len(values))) if error else np.inf
    low, high = 5, MOST_MAPS
    if not _found(effect, high):
        return np.inf
    while high - low > 1:  # `high` maps are enough, `low` are not
        middle = (low + high) // 2
        low, high = (low, middle) if _found(effect, middle) else (middle, high)
    return float(high)


def _found(effect: float, maps: int) -> bool:
    """True if so many maps tell a mean of `effect` standard deviations apart with the power that is asked for."""
    shift = effect * np.sqrt(maps)
    return bool(shift > 30 or nctdtr(maps - 1, shift, stdtrit(maps - 1, (1 + LEVEL) / 2)) <= 1 - POWER)


def ecdf(values: Array, at: Array) -> Array:
    """Share of the values (N,) that are no more than each of `at`; NaN is left out, of nothing all are NaN."""
    ordered = np.sort(values[~np.isnan(values)])
    if not len(ordered):
        return np.full(len(at), np.nan)
    shares: Array = np.searchsorted(ordered, at, side="right") / len(ordered)
    return shares


def share_under(values: Array, bound: float) -> float:
    """Share of the values (N,) below the bound; NaN is left out."""
    counted = values[~np.isnan(values)]
    return float(np.mean(counted < bound)) if len(counted) else np.nan


def bands(curves: Array) -> Array:
    """Lower quartile, median and upper quartile (3, T) over maps of curves (n, T), of those not NaN then."""
    found = np.full((3, curves.shape[1]), np.nan)
    held = ~np.isnan(curves).all(axis=0)
    found[:, held] = np.nanquantile(curves[:, held], [0.25, 0.5, 0.75], axis=0)
    return found
