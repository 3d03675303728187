"""Means and medians over maps with bootstrap intervals, empirical distributions, and bands over time.

Intervals are of 95 %, each for itself: of twenty comparisons, one is expected to miss.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from tracking.compiled import Array

LEVEL = 0.95
RESAMPLES = 5000
_SEED = 20220  # the same numbers give the same intervals, in any process
_CHUNK = 1_000_000  # indices drawn at once
_PRODUCT = 250_000  # multiplications at once: OpenBLAS does so many in one thread, and threads wait for busy cores


@dataclass(frozen=True)
class Estimate:
    """A value with its interval; NaN where there is none."""

    value: float = np.nan
    low: float = np.nan
    high: float = np.nan


NO_ESTIMATE = Estimate()


@lru_cache(maxsize=4)
def _resamples(n: int) -> tuple[NDArray[np.uint16], NDArray[np.int64]]:
    """How often each of n maps is in each resample (B, n), and the ranks of its two middle maps (B, 2)."""
    rng = np.random.default_rng((_SEED, n))
    counts = np.empty((RESAMPLES, n), dtype=np.uint16)
    middle = np.empty((RESAMPLES, 2), dtype=np.int64)
    places = [(n - 1) // 2, n // 2]
    step = max(1, _CHUNK // n)
    for start in range(0, RESAMPLES, step):
        drawn = rng.integers(0, n, (min(step, RESAMPLES - start), n))
        rows = slice(start, start + len(drawn))
        flat = (drawn + n * np.arange(len(drawn))[:, None]).ravel()
        counts[rows] = np.bincount(flat, minlength=drawn.size).reshape(drawn.shape)
        middle[rows] = np.partition(drawn, places, axis=1)[:, places]
    return counts, middle


def resampled_means(values: Array) -> Array:
    """Means (M, B) of the resamples of n maps; values (n, M), finite."""
    counts, _ = _resamples(len(values))
    step = max(1, _PRODUCT // max(1, values.size))
    chunks = (counts[start : start + step].astype(float) for start in range(0, RESAMPLES, step))
    return np.concatenate([values.T @ chunk.T for chunk in chunks], axis=1) / len(values)


def resampled_medians(values: Array) -> Array:
    """Medians (M, B) of the same resamples; values (n, M), finite.

    A resample of ranks stands for one of the sorted values, so one draw serves every column.
    """
    _, middle = _resamples(len(values))
    ordered = np.sort(values.T, axis=1)
    return 0.5 * (ordered[:, middle[:, 0]] + ordered[:, middle[:, 1]])


def means(values: Array) -> list[Estimate]:
    """The mean of each column of values (n, M) with its BCa interval; NaN and infinity are left out.

    BCa, as errors are skewed: it shifts the percentiles by bias and skewness, and is second-order accurate. A column
    whose values are all equal has an interval of no width, one of a single value has none.
    Source: B. Efron, Better bootstrap confidence intervals, JASA, 1987.
    """
    return _by_column(values, _means)


def medians(values: Array) -> list[Estimate]:
    """The median of each column of values (n, M) with its percentile interval; NaN and infinity are left out.

    Percentiles, as the jackknife that BCa rests on is inconsistent for a median.
    """
    return _by_column(values, _medians)


def _by_column(values: Array, estimates: Callable[[Array], list[Estimate]]) -> list[Estimate]:
    """Estimates of every column, those without gaps together, the others one by one."""
    found = np.isfinite(values)
    whole: NDArray[np.bool_] = np.all(found, axis=0)
    together = iter(estimates(values[:, whole]))
    kept = (values[column, j : j + 1] for j, column in enumerate(found.T))
    return [next(together) if full else estimates(part)[0] for full, part in zip(whole, kept, strict=True)]


def _means(values: Array) -> list[Estimate]:
    if len(values) < 2 or values.shape[1] == 0:
        return _without_interval(values)
    centre = values.mean(axis=0)
    drawn = resampled_means(values)
    # A resample that holds each map once has the mean itself, whatever the order in which it was added.
    slack = 1e-12 * np.abs(values).max(axis=0)
    under, over = (np.mean(drawn < (centre + side)[:, None], axis=1) for side in (-slack, slack))
    residuals = values - centre
    spread = np.sum(residuals**2, axis=0)
    flat = np.ptp(values, axis=0) == 0
    # The jackknife's skewness, which for a mean is that of the values themselves.
    skewness = np.sum(residuals**3, axis=0) / (6 * np.where(flat, 1.0, spread) ** 1.5)
    shift = np.where(flat, 0.0, ndtri(0.5 * (under + over)))
    z = shift + ndtri([[(1 - LEVEL) / 2], [(1 + LEVEL) / 2]])
    low, high = _quantiles(drawn, ndtr(shift + z / (1 - skewness * z)))
    low[flat], high[flat] = centre[flat], centre[flat]
    return [Estimate(*row) for row in np.column_stack([centre, low, high]).tolist()]


def _medians(values: Array) -> list[Estimate]:
    if len(values) < 2 or values.shape[1] == 0:
        return _without_interval(values)
    sides = np.broadcast_to([[(1 - LEVEL) / 2], [(1 + LEVEL) / 2]], (2, values.shape[1]))
    low, high = _quantiles(resampled_medians(values), sides)
    return [Estimate(*row) for row in np.column_stack([np.median(values, axis=0), low, high]).tolist()]


def _without_interval(values: Array) -> list[Estimate]:
    return [Estimate(float(column[0])) if len(column) else NO_ESTIMATE for column in values.T]


def _quantiles(drawn: Array, shares: Array) -> Array:
    """Of each row of drawn (M, B) the quantiles at its column of shares (K, M), linear between resamples."""
    ordered = np.sort(drawn, axis=1)
    place = shares * (drawn.shape[1] - 1)
    before = np.floor(place).astype(int)
    rows = np.arange(len(drawn))
    start, end = ordered[rows, before], ordered[rows, np.minimum(before + 1, drawn.shape[1] - 1)]
    found: Array = start + (place - before) * (end - start)
    return found


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
