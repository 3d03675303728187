"""Distance between sets of estimated and true positions, and between sets of whole trajectories."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from tracking.numerics.compiled import Array
from tracking.numerics.elementary import power, power_each
from tracking.numerics.matrices import length


class Ospa(NamedTuple):
    """OSPA distance [m] and its parts: localisation^p + cardinality^p = distance^p."""

    distance: float
    localisation: float
    cardinality: float


def ospa(estimates: Array, truths: Array, c: float = 50.0, p: float = 2.0) -> Ospa:
    """Optimal subpattern assignment distance between estimates (A, 2) and truths (B, 2), all in m.

    c > 0 is the cut-off [m] and the price of a missing or a false estimate, p >= 1 the order. Source: [Schuhmacher08].
    Note: [Li22] IV prints the distances without the power p of the definition; here they have it.
    """
    X, Y = points("estimates", estimates), points("truths", truths)
    return _between(length(X[:, None] - Y[None]), c, p)


def ospa2(estimates: Array, truths: Array, c: float = 50.0, p: float = 2.0) -> Ospa:
    """OSPA(2), the OSPA distance between sets of trajectories: estimates (K, A, 2) and truths (K, B, 2), in m.

    A trajectory is a column: where it is at each of K instants, NaN where it is not. Two of them are apart by the mean
    of their distances, cut off at c, over the instants at which either is there; where only one is, that is c. So one
    pairing must do for all instants: a track that changes from one person to another pays for both. Columns that are
    never there count for nothing. For the last instants alone, give these alone, or see `ospa2_over_time`.
    Source: [Beard20].
    """
    X, Y = np.asarray(estimates, dtype=float), np.asarray(truths, dtype=float)
    if X.ndim != 3 or Y.ndim != 3 or len(X) != len(Y):
        raise ValueError(f"estimates and truths must be (K, A, 2) and (K, B, 2), are {X.shape} and {Y.shape}")
    here, there = ~np.isnan(X[..., 0]), ~np.isnan(Y[..., 0])
    X, Y = X[:, here.any(axis=0)], Y[:, there.any(axis=0)]
    here, there = here[:, here.any(axis=0)], there[:, there.any(axis=0)]
    gaps = length(X[:, :, None] - Y[:, None])
    both, either = here[:, :, None] & there[:, None], here[:, :, None] | there[:, None]
    total = np.where(both, np.minimum(gaps, c), np.where(either, c, 0.0)).sum(axis=0)
    return _between(total / either.sum(axis=0), c, p)


def ospa2_over_time(estimates: Array, truths: Array, window: int, c: float = 50.0, p: float = 2.0) -> Array:
    """OSPA(2) distance (K,) m over the last `window` instants up to each; fewer at the start. Else as `ospa2`."""
    if window < 1:
        raise ValueError(f"window must be at least 1 instant, is {window}")
    slices = [slice(max(0, k - window), k) for k in range(1, len(estimates) + 1)]
    return np.array([ospa2(estimates[s], truths[s], c, p).distance for s in slices])


def points(name: str, positions: Array) -> Array:
    """Positions (A, 2); what is empty has any shape. ValueError for whole states, which are no pairs of points."""
    found = np.asarray(positions, dtype=float)
    if found.size and found.shape[-1:] != (2,):
        raise ValueError(f"{name} must be (A, 2), are {found.shape}")
    return found.reshape(-1, 2)


def _between(gaps: Array, c: float, p: float) -> Ospa:
    """OSPA of two sets whose members are `gaps` (A, B) m apart."""
    if not (c > 0 and p >= 1):
        raise ValueError(f"c must be positive and p at least 1, are {c} and {p}")
    most, fewest = max(gaps.shape), min(gaps.shape)
    if most == 0:
        return Ospa(0.0, 0.0, 0.0)
    cost = power_each(np.minimum(gaps, c), p)
    near = float(cost[linear_sum_assignment(cost)].sum()) / most
    missing = (power(c, p) * (most - fewest)) / most
    return Ospa(power(near + missing, 1 / p), power(near, 1 / p), power(missing, 1 / p))
