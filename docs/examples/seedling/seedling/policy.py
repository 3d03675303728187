"""The policy, compiled: scores of a UAV's moves, and the move it flies; the same bits on every processor."""

import math

import numpy as np

from seedling.weights import Weights
from understory import Array, compiled, exp

_ALIKE = 0.45  # of the reach: moves this near to the best are averaged with it


@compiled
def scores(weights: Weights, pairs: Array, places: Array) -> Array:
    """Scores (K,) of moves with features (K, T, P) and (K, Q); the activation is x / (1 + |x|)."""
    pooled, hidden = len(weights.pair), len(weights.joint)
    out, inputs = np.zeros(len(places)), np.empty(pooled + places.shape[1])
    for k in range(len(places)):
        inputs[:pooled] = 0.0
        inputs[pooled:] = places[k]
        for t in range(pairs.shape[1]):
            for h in range(pooled):
                z = 0.0
                for i in range(pairs.shape[2]):
                    z += weights.pair[h, i] * pairs[k, t, i]
                inputs[h] += z / (1.0 + abs(z))
        for i in range(len(inputs)):
            out[k] += weights.linear[i] * inputs[i]
        for h in range(hidden):
            z = 0.0
            for i in range(len(inputs)):
                z += weights.joint[h, i] * inputs[i]
            out[k] += weights.score[h] * z / (1.0 + abs(z))
    return out


@compiled
def chosen(scores: Array, moves: Array, reach: float) -> Array:
    """The move (2,) m to fly: the mean of the best of (K, 2) m and those near it, weighted by exp(score)."""
    best = 0
    for k in range(len(scores)):
        if scores[k] > scores[best]:
            best = k
    x, y, total = 0.0, 0.0, 0.0
    for k in range(len(scores)):
        dx, dy = moves[k, 0] - moves[best, 0], moves[k, 1] - moves[best, 1]
        if math.sqrt(dx * dx + dy * dy) <= _ALIKE * reach:
            weight = exp(scores[k] - scores[best])
            x, y, total = x + weight * moves[k, 0], y + weight * moves[k, 1], total + weight
    return np.array([x / total, y / total])
