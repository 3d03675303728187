"""Which tracks are likeliest to be the same people, by their beliefs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from tracking.numerics.compiled import Array
from tracking.numerics.matrices import log_determinant, squared_distance


def matches(ours: tuple[Array, Array], theirs: tuple[Array, Array], gate: float) -> list[tuple[int, int]]:
    """Likeliest pairs of beliefs (A, 4), (A, 4, 4) and (B, 4), (B, 4, 4) in squared distance up to `gate`."""
    if len(ours[0]) == 0 or len(theirs[0]) == 0:
        return []
    spreads = ours[1][:, None] + theirs[1][None]
    distance = squared_distance(ours[0][:, None] - theirs[0][None], spreads)
    return likeliest(distance <= gate, distance + log_determinant(spreads))


def likeliest(able: NDArray[np.bool_], cost: Array) -> list[tuple[int, int]]:
    """As many able pairs (A, B) as there can be, at the least cost (A, B) of twice a negative log-likelihood."""
    finite = np.isfinite(cost)  # which it is not where a covariance is not positive definite
    able = able & finite
    # No pair costs more than all pairs together, so the assignment makes as many as it can.
    most = 1.0 + np.abs(np.where(finite, cost, 0.0)).sum()
    rows, columns = linear_sum_assignment(np.where(able, cost, most))
    return [(int(a), int(b)) for a, b in zip(rows, columns, strict=True) if able[a, b]]


def crosswise(named: NDArray[np.bool_], near: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pairs (A, B) of which each one's namesake agrees with the other's, too, while the namesakes do not both agree.

    named, near (A, B): which pairs have a common name, and which agree.
    """
    out = np.zeros_like(named)
    for a, b in np.argwhere(near & ~named).tolist():
        for k, j in np.argwhere(named[:, b][:, None] & named[a][None] & near).tolist():
            out[a, b] |= not (near[a, j] and near[k, b])
    return out
