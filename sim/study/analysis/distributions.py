"""Empirical distributions, and quartiles over time."""

import numpy as np

from tracking.numerics.arrays import Array


def compute_ecdf(values: Array, at: Array) -> Array:
    """Share of the values (N,) that are no more than each of `at`; NaN is left out, and no values give NaN."""
    ordered = np.sort(values[~np.isnan(values)])
    if not len(ordered):
        return np.full(len(at), np.nan)
    shares: Array = np.searchsorted(ordered, at, side="right") / len(ordered)
    return shares


def compute_share_under(values: Array, bound: float) -> float:
    """Share of the values (N,) that are below a bound; NaN is left out."""
    counted = values[~np.isnan(values)]
    return float(np.mean(counted < bound)) if len(counted) else np.nan


def find_quartiles(curves: Array) -> Array:
    """Lower quartile, median and upper quartile (3, T) of curves (n, T) at each scan; NaN is left out."""
    found = np.full((3, curves.shape[1]), np.nan)
    held = ~np.isnan(curves).all(axis=0)
    found[:, held] = np.nanquantile(curves[:, held], [0.25, 0.5, 0.75], axis=0)
    return found
