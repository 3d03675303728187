"""Motion model of nearly constant velocity with a bound on speed."""

import math
from dataclasses import dataclass

import numpy as np

from tracking.filter.kalman import NearlyConstantVelocity
from tracking.geometry.visibility import SAMPLES
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length
from tracking.numerics.factorisation import cholesky
from tracking.numerics.matrices import product, symmetric
from tracking.numerics.stacks import forward_solutions

# Equally probable points of the plane (36, 2) with the moments of a standard normal distribution.
_POINTS = SAMPLES / SAMPLES.std(axis=0)
_FARTHEST = float(length(_POINTS).max())


@dataclass(frozen=True)
class BoundedSpeed(NearlyConstantVelocity):
    """Nearly constant velocity, with faster velocities shortened to `max_speed`.

    Over a step v' = c(v) + a dt and p' = p + c(v) dt + a dt² / 2, where c shortens velocities longer than `max_speed`.
    So the mean velocity never exceeds it, and per step the root mean square distance from any place grows by
    `max_speed` dt and NCV's own noise at most. A belief without faster velocities is predicted as by NCV, to the bit.
    """

    max_speed: float  # m/s

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.max_speed > 0.0:
            raise ValueError(f"max_speed must be positive, is {self.max_speed}")
        if self.scans != 1:
            raise ValueError(f"scans must be 1 where speed is bounded, which no sum over scans is, is {self.scans}")

    def predict_all(self, means: Array, covariances: Array) -> tuple[Array, Array]:
        """Predict a stack of beliefs one step ahead: means (T, 4), covariances (T, 4, 4)."""
        reach = length(means[:, 2:]) + _FARTHEST * np.sqrt(covariances[:, 2, 2] + covariances[:, 3, 3])
        fast = np.flatnonzero(reach > self.max_speed)
        if len(fast):
            means, covariances = means.copy(), covariances.copy()
            means[fast], covariances[fast] = _limited(means[fast], covariances[fast], self.max_speed)
        return super().predict_all(means, covariances)


def _limited(means: Array, covariances: Array, max_speed: float) -> tuple[Array, Array]:
    """Moments of beliefs whose velocities c has shortened, by samples. Positions stay.

    With v = mean + L u and d = c(v) - v, the state is mean + G u + a rest that is independent of v. The covariance is
    that of G u + d over the samples u plus that of the rest. So its position block stays positive definite; the
    velocity block gets the step's noise before it is inverted.
    """
    roots = cholesky(covariances[:, 2:, 2:])
    moments = _shortened(means[:, 2:], roots, max_speed) / len(_POINTS)
    shift, within, across = moments[:, 0], moments[:, 1:3], moments[:, 3:]
    G = np.swapaxes(forward_solutions(roots, np.ascontiguousarray(covariances[:, 2:, :])), 1, 2)
    limited = covariances.copy()
    both = product(G, across)
    limited[:, :, 2:] += both
    limited[:, 2:, :] += np.swapaxes(both, 1, 2)
    limited[:, 2:, 2:] += within - shift[:, :, None] * shift[:, None, :]
    moved = means.copy()
    moved[:, 2:] += shift
    return moved, symmetric(limited)


@compiled
def _shortened(means: Array, roots: Array, max_speed: float) -> Array:
    """Sums (T, 5, 2) over the samples u of d, d dᵀ and u dᵀ, one below the other.

    Velocities are mean + L u with means (T, 2) and roots L (T, 2, 2).
    """
    sums = np.zeros((len(means), 5, 2))
    d = np.empty(2)
    for t in range(len(means)):
        for k in range(len(_POINTS)):
            x = means[t, 0] + roots[t, 0, 0] * _POINTS[k, 0]
            y = means[t, 1] + roots[t, 1, 0] * _POINTS[k, 0] + roots[t, 1, 1] * _POINTS[k, 1]
            speed = math.sqrt(x * x + y * y)
            if speed <= max_speed:
                continue
            d[0], d[1] = x * (max_speed / speed - 1.0), y * (max_speed / speed - 1.0)
            for i in range(2):
                sums[t, 0, i] += d[i]
                for j in range(2):
                    sums[t, 1 + j, i] += d[j] * d[i]
                    sums[t, 3 + j, i] += _POINTS[k, j] * d[i]
    return sums
