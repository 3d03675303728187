"""Mutual information between targets' paths and their measurements, compiled."""

from planning.prediction.predicted_belief import LANES, advance_belief
from tracking.filter.kalman import Transition
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import replace_by_logs


@compiled
def advance_with_gains(P: Array, transition: Transition, noise: Array, information: Array, costs: Array) -> None:
    """Apply `advance_belief` to P, and set `costs` (LANES,) to minus the information gained.

    The gain is the mutual information [nats] between a state one step later and its measurements, ½ log det(I + J P_pp)
    with the predicted position block and the measurements' information J. By the chain rule, the sum over steps is
    the mutual information between the path and all measurements. This sum is monotone and submodular in the
    measurements, because they are independent given the path [Krause05].
    """
    advance_belief(P, transition, noise, information, costs)
    replace_by_logs(costs)
    for k in range(LANES):
        costs[k] *= -0.5
