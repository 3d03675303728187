"""Prediction of beliefs in positions and velocities by a linear motion model, compiled."""

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled


@compiled
def predict_linear(means: Array, covariances: Array, transition: tuple[float, float], Q: Array) -> tuple[Array, Array]:
    """F ξ (T, 4) and the symmetric F P Fᵀ + Q (T, 4, 4), with F = [[I, w I], [0, l I]] by `transition` (w, l)."""
    moved, spread, half = np.empty_like(means), np.empty_like(covariances), np.empty((4, 4))
    way, left = transition
    for t in range(len(means)):
        for i in range(2):
            moved[t, i] = means[t, i] + way * means[t, 2 + i]
            moved[t, 2 + i] = left * means[t, 2 + i]
            for j in range(4):
                half[i, j] = covariances[t, i, j] + way * covariances[t, 2 + i, j]
                half[2 + i, j] = left * covariances[t, 2 + i, j]
        for i in range(4):
            for j in range(i, 4):
                total = half[i, j] + way * half[i, j + 2] if j < 2 else left * half[i, j]
                spread[t, i, j] = spread[t, j, i] = total + Q[i, j]
    return moved, spread
