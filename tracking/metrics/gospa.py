"""GOSPA distance between sets of estimated and true positions, with its parts."""

from typing import NamedTuple

import numpy as np

from tracking.metrics.ospa import checked_positions
from tracking.numerics.arrays import Array
from tracking.numerics.assignment import least_costs
from tracking.numerics.distances import length
from tracking.numerics.exponential import power, power_each


class Gospa(NamedTuple):
    """GOSPA distance [m] and its parts: localisation^p + missed^p + false^p = distance^p.

    Each missed truth and each false estimate adds c^p / 2 to the p-th power of its part.
    """

    distance: float
    localisation: float
    missed: float
    false: float


def gospa(estimates: Array, truths: Array, c: float = 10.0, p: float = 2.0) -> Gospa:
    """Generalised OSPA distance, alpha = 2, between estimates (A, 2) and truths (B, 2), all in m.

    c > 0 is the cut-off [m]: an estimate and a truth at least this far apart count as a false estimate and a missed
    truth. p >= 1 is the order. Unlike OSPA, GOSPA is a sum over targets, not a mean. Source: [Rahmathullah17].
    """
    if not (c > 0 and p >= 1):
        raise ValueError(f"c must be positive and p at least 1, are {c} and {p}")
    X, Y = checked_positions("estimates", estimates), checked_positions("truths", truths)
    gaps = length(X[:, None] - Y[None])
    costs, most = least_costs(power_each(np.minimum(gaps, c), p)), power(c, p)
    near = costs[costs < most]
    far = most / 2
    localisation, missed, false = float(near.sum()), (len(Y) - len(near)) * far, (len(X) - len(near)) * far
    return Gospa(*(power(part, 1 / p) for part in (localisation + missed + false, localisation, missed, false)))
