"""GOSPA distance between sets of estimated and true positions, with its parts."""

from typing import NamedTuple

import numpy as np

from tracking.metrics.ospa import check_metric, check_positions
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

    c is the cut-off [m]: an estimate and a truth at least this far apart count as a false estimate and a missed truth.
    p is the order, from 1 to 10. Unlike OSPA, GOSPA is a sum over targets, not a mean. Source: [Rahmathullah17].
    """
    check_metric(c, p)
    X, Y = check_positions("estimates", estimates), check_positions("truths", truths)
    costs = least_costs(power_each(np.minimum(length(X[:, None] - Y[None]), c), p))
    inside, half = costs[costs < power(c, p)], power(c, p) / 2
    sums = float(inside.sum()), (len(Y) - len(inside)) * half, (len(X) - len(inside)) * half
    return Gospa(power(sums[0] + sums[1] + sums[2], 1 / p), *(power(part, 1 / p) for part in sums))
