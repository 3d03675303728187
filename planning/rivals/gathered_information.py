"""Information that UAVs gather from a few places each, compiled."""

from typing import NamedTuple

import numpy as np

from planning.prediction.predicted_belief import LANES, PredictedBelief, add_information, advance_with_gains
from tracking.filter.kalman import Transition
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled


class Prior(NamedTuple):
    """Belief before any measurement: T K trajectories in blocks of LANES, side by side."""

    P: Array  # (B, 10 LANES), as `advance_belief` takes it
    weights: Array  # (B, LANES): weight of each trajectory
    transition: Transition  # of velocities over a step
    noise: Array  # (3,): process noise of a step


def build_prior(belief: PredictedBelief) -> Prior:
    """Present covariances of a belief, one for each trajectory."""
    (_, T, K), (rows, columns) = belief.points.shape[:3], np.triu_indices(4)
    blocks = -(-T * K // LANES)
    P, weights = np.zeros((10, blocks * LANES)), np.zeros(blocks * LANES)
    P[:, : T * K] = np.repeat(belief.covariances[:, rows, columns], K, axis=0).T
    weights[: T * K] = np.repeat(belief.weights, K) / K
    side_by_side = np.ascontiguousarray(P.reshape(10, blocks, LANES).swapaxes(0, 1).reshape(blocks, 10 * LANES))
    return Prior(side_by_side, weights.reshape(blocks, LANES), belief.transition, belief.noise)


@compiled
def gather_information(belief: PredictedBelief, uav: int, cameras: Array, steps: Indices) -> Array:
    """Information (C, B, 3 LANES) of a UAV's measurements at `cameras` (C, 2) m after `steps` (C,), which ascend."""
    each = belief.points.shape[1] * belief.points.shape[2]
    table = np.zeros((len(cameras), -(-each // LANES), 3 * LANES))
    lanes, information, free, first = np.empty((2, LANES)), np.empty(3 * LANES), np.empty(LANES), 0
    while first < len(cameras):
        last = first
        while last < len(cameras) and last - first < LANES and steps[last] == steps[first]:
            last += 1
        for lane in range(LANES):
            lanes[0, lane], lanes[1, lane] = cameras[min(first + lane, last - 1)]
        for index in range(each):
            information[:] = 0.0
            if add_information(belief, uav, lanes, steps[first] * each + index, information, free):
                for lane in range(last - first):
                    for k in range(3):
                        table[first + lane, index // LANES, k * LANES + index % LANES] = information[k * LANES + lane]
        first = last
    return table


@compiled
def gain_of(prior: Prior, information: Array) -> float:
    """Mutual information [nats] between people's paths and measurements that have `information` (H, B, 3 LANES)."""
    total, costs = 0.0, np.empty(LANES)
    for block in range(len(prior.P)):
        P = prior.P[block].copy()
        for step in range(len(information)):
            advance_with_gains(P, prior.transition, prior.noise, information[step, block], costs)
            for lane in range(LANES):
                total -= prior.weights[block, lane] * costs[lane]
    return total
