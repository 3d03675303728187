"""Tests of differences over maps, and the number of maps that a test needs."""

from bisect import bisect_left
from collections.abc import Sequence

import numpy as np
from scipy.special import nctdtr, stdtr, stdtrit

from sim.analysis.intervals import LEVEL, moments
from tracking.numerics.arrays import Array

POWER = 0.8  # with which `maps_needed` finds a difference
MOST_MAPS = 9999  # beyond which no number is told


def chances(values: Array) -> list[float]:
    """For each column of differences (n, M) the p-value of no difference in the mean; 1 where nothing is known.

    The interval of `means` at the level 1 - p ends at zero, so p is below 5 % where that of 95 % leaves zero out. It
    is never below 2 / 2ⁿ, the least that n maps can give a test without assumptions on the distribution; so nothing
    is told apart on fewer than six.
    """
    return [_chance(column[np.isfinite(column)]) for column in values.T]


def holm(chances: Sequence[float]) -> list[bool]:
    """Marks of the p-values that stay below 5 % when all are judged together.

    Source: S. Holm, A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics, 1979.
    """
    order = np.argsort(chances, kind="stable")
    adjusted = np.array(chances)[order] * np.arange(len(chances), 0, -1)
    kept = np.zeros(len(chances), dtype=bool)
    kept[order] = np.maximum.accumulate(adjusted) <= 1 - LEVEL
    return kept.tolist()


def maps_needed(values: Array) -> list[float]:
    """For each column of differences (n, M) the number of maps that would tell it apart from zero; infinity: too many.

    The least number for which a paired t test of 5 %, two-sided, finds a true difference of the mean observed with a
    probability of 80 %, if maps differ by the standard deviation observed; never fewer than six. NaN of fewer than two.
    """
    return [_needed(column[np.isfinite(column)]) for column in values.T]


def _chance(values: Array) -> float:
    n = len(values)
    if n < 2:
        return 1.0
    centre, error, unit = moments(values)
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


def _needed(values: Array) -> float:
    if len(values) < 2:
        return np.nan
    centre, error, _ = moments(values)
    if centre == 0:
        return np.inf
    effect = abs(centre) / (error * np.sqrt(len(values))) if error else np.inf
    numbers = range(6, MOST_MAPS + 1)
    first = bisect_left(numbers, True, key=lambda maps: _found(effect, maps))
    return float(numbers[first]) if first < len(numbers) else np.inf


def _found(effect: float, maps: int) -> bool:
    """True if so many maps tell a mean of `effect` standard deviations apart with the power that is asked for."""
    shift = effect * np.sqrt(maps)
    return bool(shift > 30 or nctdtr(maps - 1, shift, stdtrit(maps - 1, (1 + LEVEL) / 2)) <= 1 - POWER)
