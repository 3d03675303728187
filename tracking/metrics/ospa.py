"""OSPA and GOSPA distance between sets of estimated and true positions, and OSPA(2) between sets of trajectories."""

import math
from typing import NamedTuple

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.assignment import least_costs, least_largest_costs
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length
from tracking.numerics.exponential import power

_AT_ONCE = 2_000_000  # most distances computed at once: all those of a long mission would take gigabytes


class Ospa(NamedTuple):
    """OSPA distance [m] and its parts: localisation^p + cardinality^p = distance^p; the larger one if p = inf."""

    distance: float
    localisation: float
    cardinality: float


class Gospa(NamedTuple):
    """GOSPA distance [m] and its parts: localisation^p + missed^p + false^p = distance^p; the largest part if p = inf.

    Each missed truth and each false estimate adds c^p / 2 to the p-th power of its part, which is c if p is infinite.
    """

    distance: float
    localisation: float
    missed: float
    false: float


def ospa(estimates: Array, truths: Array, c: float = 50.0, p: float = 2.0) -> Ospa:
    """Optimal subpattern assignment distance between estimates (A, 2) and truths (B, 2), all in m.

    c is the cut-off [m], from 1e-9 to 1e9, and the cost of a missing or false estimate; p the order, from 1 to 10, or
    infinity, with which the distance is that of the farthest pair, or c if the sizes differ. Source: [Schuhmacher08].
    Note: [Li22] IV prints the distances without the power p, which the definition has.
    """
    X, Y = check_positions("estimates", estimates), check_positions("truths", truths)
    return _score_gaps(_find_gaps(X, Y), c, p)


def ospa2(estimates: Array, truths: Array, c: float = 50.0, p: float = 2.0) -> Ospa:
    """OSPA(2), the OSPA distance between sets of trajectories: estimates (K, A, 2) and truths (K, B, 2), in m.

    A trajectory is a column: its position at each of K instants, NaN while it is absent. The distance of two
    trajectories is a mean over the instants at which either is present: of the distance of their positions, cut off at
    c, or of c if only one is present. One pairing holds for all instants, so a track that changes from one person to
    another costs for both. Columns that are never present do not count. Source: [Beard20].
    """
    X, Y = np.asarray(estimates, dtype=float), np.asarray(truths, dtype=float)
    if any(Z.ndim != 3 or Z.shape[2] != 2 for Z in (X, Y)) or len(X) != len(Y):
        raise ValueError(f"estimates and truths must be (K, A, 2) and (K, B, 2), are {X.shape} and {Y.shape}")
    if any((np.isfinite(Z).any(axis=2) != np.isfinite(Z).all(axis=2)).any() or np.isinf(Z).any() for Z in (X, Y)):
        raise ValueError("estimates and truths must be finite, or NaN in both coordinates where absent")
    X, Y = (Z[:, ~np.isnan(Z[..., 0]).all(axis=0)] for Z in (X, Y))
    total, instants = np.zeros((X.shape[1], Y.shape[1])), np.zeros((X.shape[1], Y.shape[1]), dtype=np.int64)
    block = max(1, _AT_ONCE // max(total.size, 1))
    for first in range(0, len(X), block):
        x, y = X[first : first + block, :, None], Y[first : first + block, None]
        here, there = ~np.isnan(x[..., 0]), ~np.isnan(y[..., 0])
        either = here | there
        gaps = np.where(here & there, np.minimum(length(x - y), c), np.where(either, c, 0.0))
        total += gaps.sum(axis=0)
        instants += either.sum(axis=0)
    return _score_gaps(total / instants, c, p)


def _score_gaps(gaps: Array, c: float, p: float) -> Ospa:
    """OSPA of two sets whose members are `gaps` (A, B) m apart."""
    check_metric(c, p)
    most, fewest = max(gaps.shape), min(gaps.shape)
    if p == math.inf:
        near = least_largest_costs(gaps, c)
        farthest = near.max(initial=0.0).item() if len(near) == fewest else float(c)
        missing = float(c) if most > fewest else 0.0
        return Ospa(max(farthest, missing), farthest, missing)
    total = float(least_costs(_find_powers(gaps, float(c), float(p))).sum()) / max(most, 1)
    lacking = power(c, p) * (most - fewest) / max(most, 1)
    return Ospa(power(total + lacking, 1 / p), power(total, 1 / p), power(lacking, 1 / p))


def gospa(estimates: Array, truths: Array, c: float = 10.0, p: float = 2.0) -> Gospa:
    """Generalised OSPA distance, alpha = 2, between estimates (A, 2) and truths (B, 2), all in m.

    c is the cut-off [m]: an estimate and a truth at least this far apart count as a false estimate and a missed truth.
    p is the order, from 1 to 10 or infinity, as for `ospa`. Unlike OSPA, GOSPA is a sum over targets, not a mean.
    Source: [Rahmathullah17].
    """
    check_metric(c, p)
    X, Y = check_positions("estimates", estimates), check_positions("truths", truths)
    gaps = _find_gaps(X, Y)
    if p == math.inf:
        near = least_largest_costs(gaps, c)
        parts = near.max(initial=0.0).item(), *(float(c) if len(Z) > len(near) else 0.0 for Z in (Y, X))
        return Gospa(max(parts), *parts)
    costs = least_costs(_find_powers(gaps, float(c), float(p)))
    inside, half = costs[costs < power(c, p)], power(c, p) / 2
    sums = float(inside.sum()), (len(Y) - len(inside)) * half, (len(X) - len(inside)) * half
    return Gospa(power(sums[0] + sums[1] + sums[2], 1 / p), *(power(part, 1 / p) for part in sums))


@compiled
def _find_gaps(one: Array, other: Array) -> Array:
    """Distances (A, B) between points (A, 2) and (B, 2)."""
    gaps = np.empty((len(one), len(other)))
    for a in range(len(one)):
        for b in range(len(other)):
            x, y = one[a, 0] - other[b, 0], one[a, 1] - other[b, 1]
            gaps[a, b] = math.sqrt(x * x + y * y)
    return gaps


@compiled
def _find_powers(gaps: Array, c: float, p: float) -> Array:
    """The p-th powers of distances (A, B), cut off at c."""
    powers = np.empty(gaps.shape)
    for a in range(gaps.shape[0]):
        for b in range(gaps.shape[1]):
            powers[a, b] = power(min(gaps[a, b], c), p)
    return powers


def check_metric(c: float, p: float) -> None:
    """Raise ValueError unless the cut-off c [m] and the order p are those of a metric whose powers are floats."""
    if not (1e-9 <= c <= 1e9 and (1 <= p <= 10 or p == math.inf)):
        raise ValueError(f"c must be from 1e-9 to 1e9 and p from 1 to 10 or infinite, are {c} and {p}")


def check_positions(name: str, positions: Array) -> Array:
    """Return positions as an array (A, 2); an empty one may also be (0,) or (0, n).

    Raises ValueError for other shapes, as of states, and for positions that are not finite.
    """
    found = np.require(positions, float, ("C", "W"))  # for other arrays Numba would compile functions once more
    if found.ndim > 2 or (found.size and found.shape[1:] != (2,)):
        raise ValueError(f"{name} must be (A, 2), are {found.shape}")
    found = found.reshape(-1, 2)
    if not all(map(math.isfinite, found.ravel().tolist())):  # faster than NumPy's for a few
        first = np.isfinite(found).all(axis=1).argmin()
        raise ValueError(f"{name}[{first}] is not finite; leave absent ones out")
    return found
