"""Means and medians over maps with their intervals, tests of differences, and the number of maps that a test needs.

The samples are maps; a map's value is the mean over its repeats. Intervals are of 95 % without correction for their
number: of twenty, one is expected to miss.
"""

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import bdtrik, nctdtr, stdtr, stdtrit

from sim.facts.metrics.metric import Metric
from tracking.numerics.arrays import Array

LEVEL = 0.95
POWER = 0.8  # probability that `count_maps_needed` maps detect a difference
LEAST_MAPS = 6  # least number of maps without a tie that can tell planners apart: p is never below 2 / 2ⁿ
MOST_MAPS = 9999  # largest number of maps that is reported
_UNSEEN = 0.08  # number of maps that a sample may lack, with values at the far end of what a share can be


@dataclass(frozen=True)
class Estimate:
    """A value with its interval; NaN if there is none."""

    value: float = np.nan
    low: float = np.nan
    high: float = np.nan

    def text(self, metric: Metric, *, signed: bool = False) -> str:
        """The value and, in brackets, the interval if there is one, in the metric's unit, without the unit's name."""
        value, low, high = (metric.text(v, signed=signed) for v in (self.value, self.low, self.high))
        return value if math.isnan(self.low) else f"{value} [{low}, {high}]"

    def cut(self, least: float, most: float) -> "Estimate":
        """The estimate with its interval cut off at the bounds of possible values."""
        return replace(self, low=max(self.low, least), high=min(self.high, most))


NO_ESTIMATE = Estimate()


def estimate_means(values: Array, ranges: Sequence[float] = ()) -> list[Estimate]:
    """The mean of each column of values (n, M) with its interval; NaN and infinity are left out.

    The interval is Student's t interval with its end on the side of the longer tail moved outwards by the Edgeworth
    term γ s (1 + 2 t²) / 6n of the sample's skewness γ. Both ends are moved by 0.08 / n of the range of a metric that
    has one, `ranges` (M,): maps that are rarer than one in n and go wrong are in few samples, and move the mean. A
    single value has no interval. Nor has a column in which fewer than `LEAST_MAPS` values, or all but one of fewer,
    differ from the most common one: intervals covered 70 to 81 % where 64 to 78 % of the maps were ties.

    The factor 0.08 was chosen for differences of shares under 1 m with ten maps of docs/results/worlds.csv. On other
    trials that were flown, with 8, 10, 20 and 50 maps, the intervals contained the mean share in at least 97, 96, 96
    and 95 % of cases. docs/how-to/reports.md has the numbers for all worlds and for mean errors.
    Source: N. J. Johnson, Modified t tests and confidence intervals for asymmetrical populations, JASA, 1978; P. Hall,
    On the removal of skewness by transformation, JRSS B, 1992.
    """
    reaches = _find_reaches(values, ranges)
    return [
        replace(e, low=e.low - reach, high=e.high + reach) if reach else e
        for e, reach in zip(_estimate_by_column(values, _estimate_mean), reaches, strict=True)
    ]


def estimate_medians(values: Array) -> list[Estimate]:
    """The median of each column of values (n, M) with its interval; NaN and infinity are left out.

    The interval is from the r-th smallest to the r-th largest value, with the largest r that still covers 95 %,
    whatever the distribution. Fewer than six values cover less: from the least to the greatest, 1 - 2 / 2ⁿ.
    """
    return _estimate_by_column(values, _estimate_median)


def compute_p_values(values: Array, ranges: Sequence[float] = ()) -> list[float]:
    """The p-value of no difference in the mean, for each column of differences (n, M); 1 if nothing is known.

    ranges: as in `estimate_means`.

    The interval of `estimate_means` at the level 1 - p ends at zero, so p is below 5 % if the interval of 95 % excludes
    zero. It is never below 2 / 2ⁿ for n maps without a tie, the least p-value of the sign test, which assumes nothing
    about the distribution; fewer than six such maps therefore never show a difference.
    """
    reaches = _find_reaches(values, ranges)
    return [_compute_p_value(c[np.isfinite(c)], reach) for c, reach in zip(values.T, reaches, strict=True)]


def count_maps_needed(values: Array) -> list[float]:
    """Number of maps needed to distinguish each column of differences (n, M) from zero; infinity if too many.

    It is the least number, but at least six, for which a two-sided paired t test at 5 % finds a true difference with
    the observed mean and standard deviation with a probability of 80 %. NaN for fewer than two differences.
    """
    return [_count_needed(column[np.isfinite(column)]) for column in values.T]


def _find_reaches(values: Array, ranges: Sequence[float]) -> list[float]:
    """By how much the ends of each column's interval are moved for maps that the sample lacks; 0 without a range."""
    counts = np.count_nonzero(np.isfinite(values), axis=0).tolist()
    finite = [r if math.isfinite(r) else 0.0 for r in ranges] or [0.0] * len(counts)
    return [_UNSEEN * r / max(n, 1) for r, n in zip(finite, counts, strict=True)]


class _Moments(NamedTuple):
    """Moments of a sample."""

    mean: float
    error: float  # standard error of the mean
    correction: float  # for skewness, γ s / 6n


def _compute_moments(values: Array) -> _Moments:
    """Moments of two or more values."""
    n = len(values)
    if np.ptp(values) == 0:
        return _Moments(float(values[0]), 0.0, 0.0)
    centre = float(values.mean())
    spread = float(values.std(ddof=1))
    cubes = float(np.sum(((values - centre) / spread) ** 3))
    skewness = cubes * n / ((n - 1) * (n - 2)) if n > 2 else 0.0
    return _Moments(centre, spread / float(np.sqrt(n)), skewness * spread / (6 * n))


def _estimate_by_column(values: Array, estimate: Callable[[Array], Estimate]) -> list[Estimate]:
    """Estimates from the finite values of every column (n,); a single value has no interval."""
    columns = [column[np.isfinite(column)] for column in values.T]
    return [estimate(c) if len(c) > 1 else Estimate(float(c[0])) if len(c) else NO_ESTIMATE for c in columns]


def _has_too_many_ties(values: Array) -> bool:
    """True if too few of two or more values differ from the most common one."""
    _, counts = np.unique(values, return_counts=True)
    return len(values) - int(counts.max()) < min(LEAST_MAPS, len(values) - 1)


def _estimate_mean(values: Array) -> Estimate:
    centre, error, correction = _compute_moments(values)
    if _has_too_many_ties(values):
        return Estimate(centre)
    quantile = float(stdtrit(len(values) - 1, (1 + LEVEL) / 2))
    reach = correction * (1 + 2 * quantile**2)
    return Estimate(centre, centre - quantile * error + min(reach, 0.0), centre + quantile * error + max(reach, 0.0))


def _estimate_median(values: Array) -> Estimate:
    n = len(values)
    ordered = np.sort(values)
    # The largest r with P(Binomial(n, 1/2) < r) <= 2.5 %, or 1.
    r = max(1, math.ceil(float(bdtrik((1 - LEVEL) / 2, n, 0.5))))
    return Estimate(float(np.median(ordered)), float(ordered[r - 1]), float(ordered[n - r]))


def _compute_p_value(values: Array, unseen: float) -> float:
    n = len(values)
    if n < 2:
        return 1.0
    centre, error, correction = _compute_moments(values)
    least: float = 2.0 ** (1 - max(int(np.count_nonzero(values)), 1))
    if error == 0.0:
        return least if abs(centre) > unseen else 1.0
    # The quantile q for which the end of the interval is zero: |centre| = unseen + q error + reach (1 + 2 q²).
    reach = max(-correction if centre > 0 else correction, 0.0)
    room = abs(centre) - unseen - reach
    if room <= 0:
        return 1.0
    quantile = 2 * room / (error + np.sqrt(error**2 + 8 * reach * room))
    return max(least, 2 * float(stdtr(n - 1, -quantile)))


def _count_needed(values: Array) -> float:
    if len(values) < 2:
        return np.nan
    centre, error, _ = _compute_moments(values)
    if centre == 0:
        return np.inf
    effect = abs(centre) / (error * np.sqrt(len(values))) if error else np.inf
    numbers = range(LEAST_MAPS, MOST_MAPS + 1)
    first = bisect_left(numbers, True, key=lambda maps: _detects(effect, maps))
    return float(numbers[first]) if first < len(numbers) else np.inf


def _detects(effect: float, maps: int) -> bool:
    """True if a test with so many maps detects a mean of `effect` standard deviations with a probability of `POWER`."""
    shift = effect * np.sqrt(maps)
    return bool(shift > 30 or nctdtr(maps - 1, shift, stdtrit(maps - 1, (1 + LEVEL) / 2)) <= 1 - POWER)
