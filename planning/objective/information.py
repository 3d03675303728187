"""Mutual information between targets' paths and their measurements, compiled."""

import numpy as np

from planning.prediction.predicted_belief import LANES, advance_belief, predicted
from tracking.filter.kalman import Transition
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import replace_by_logs


@compiled
def advance_with_gains(P: Array, transition: Transition, noise: Array, information: Array, costs: Array) -> None:
    """Apply `advance_belief` to P, and set `costs` (LANES,) to minus the information gained instead of the traces.

    The gain is the mutual information [nats] between a state one step later and its measurements, ½ log det(I + J P⁻)
    with the predicted position block P⁻ and the measurements' information J. By the chain rule, the sum over steps is
    the mutual information between the path and all measurements. This sum is monotone and submodular in the
    measurements, because they are independent given the path [Krause05].
    """
    gains = np.empty(LANES)
    for k in range(LANES):
        xx, xy, _, _, yy, _, _, _, _, _ = predicted(P, k, transition, noise)
        jxx, jxy, jyy = information[k], information[LANES + k], information[2 * LANES + k]
        a, b = 1.0 + jxx * xx + jxy * xy, jxx * xy + jxy * yy
        c, d = jxy * xx + jyy * xy, 1.0 + jxy * xy + jyy * yy
        gains[k] = a * d - b * c
    replace_by_logs(gains)
    advance_belief(P, transition, noise, information, costs)
    for k in range(LANES):
        costs[k] = -0.5 * gains[k]
