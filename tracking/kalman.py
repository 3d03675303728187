"""Nearly constant velocity model and Gaussian beliefs: filterpy, wrapped once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from filterpy.common import Q_discrete_white_noise
from filterpy.kalman import predict
from filterpy.kalman import update as filterpy_update

from tracking.compiled import Array

H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Gaussian:
    """Belief on a target's state (px, py, vx, vy) in m and m/s, as in [Li22] eq. (1)."""

    mean: Array  # (4,)
    covariance: Array  # (4, 4)


@dataclass(frozen=True)
class NearlyConstantVelocity:
    """The motion model of [Li22] eq. (1)."""

    dt: float  # s
    sigma_a: float  # standard deviation of the acceleration, m/s²

    def __post_init__(self) -> None:
        if not 0.0 < self.dt < math.inf:
            raise ValueError(f"dt must be positive and finite, is {self.dt}")
        if not 0.0 <= self.sigma_a < math.inf:
            raise ValueError(f"sigma_a must be 0 or more and finite, is {self.sigma_a}")

    @cached_property
    def F(self) -> Array:
        """State transition (4, 4)."""
        F = np.eye(4)
        F[0, 2] = F[1, 3] = self.dt
        return F

    @cached_property
    def Q(self) -> Array:
        """Process noise (4, 4)."""
        Q = Q_discrete_white_noise(2, self.dt, self.sigma_a**2, block_size=2, order_by_dim=False)
        return np.asarray(Q, dtype=float)

    def predict(self, belief: Gaussian) -> Gaussian:
        """The belief one step later, without a measurement."""
        return Gaussian(*predict(belief.mean, belief.covariance, self.F, self.Q))

    def predict_all(self, means: Array, covariances: Array) -> tuple[Array, Array]:
        """`predict` for a stack of beliefs: means (T, 4), covariances (T, 4, 4), at the cost of one."""
        return means @ self.F.T, symmetric(self.F @ covariances @ self.F.T + self.Q)


def innovation(predicted: Gaussian, z: Array, R: Array) -> Gaussian:
    """Residual of a ground measurement and its covariance.

    z (2,) m, R (2, 2) m². Returns ν (2,) and S = H P Hᵀ + R (2, 2); stacks of all of them broadcast.
    """
    return Gaussian(z - predicted.mean[..., :2], predicted.covariance[..., :2, :2] + R)


def update(predicted: Gaussian, z: Array, R: Array) -> Gaussian:
    """The belief after a ground measurement z (2,) m with covariance R (2, 2) m², in Joseph's form."""
    mean, covariance = filterpy_update(predicted.mean, predicted.covariance, z, R, H)
    return Gaussian(mean, symmetric(covariance))


def information_form(means: Array, covariances: Array) -> tuple[Array, Array]:
    """Information vectors q = Ω ξ (..., 4) and matrices Ω = P⁻¹ (..., 4, 4) of a stack of beliefs."""
    omega = _inverse(covariances)
    return (omega @ means[..., None])[..., 0], omega


def moment_form(q: Array, omega: Array) -> tuple[Array, Array]:
    """Means ξ (..., 4) and covariances P (..., 4, 4) of a stack of beliefs in information form."""
    covariances = _inverse(omega)
    return (covariances @ q[..., None])[..., 0], covariances


def symmetric(matrices: Array) -> Array:
    """Matrices (..., n, n) without the asymmetry that rounding left in them."""
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


def _inverse(matrices: Array) -> Array:
    return symmetric(np.asarray(np.linalg.inv(matrices), dtype=float))
