"""Distance between sets of estimated and true positions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from tracking.compiled import Array


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
    if not (c > 0 and p >= 1):
        raise ValueError(f"c must be positive and p at least 1, are {c} and {p}")
    X, Y = np.reshape(estimates, (-1, 2)), np.reshape(truths, (-1, 2))
    most, fewest = max(len(X), len(Y)), min(len(X), len(Y))
    if most == 0:
        return Ospa(0.0, 0.0, 0.0)
    cost = np.minimum(np.linalg.norm(X[:, None] - Y[None], axis=2), c) ** p
    near = float(cost[linear_sum_assignment(cost)].sum()) / most
    missing = (c**p * (most - fewest)) / most
    return Ospa((near + missing) ** (1 / p), near ** (1 / p), missing ** (1 / p))
