"""Nearly constant velocity model and Gaussian beliefs: filterpy, wrapped once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from filterpy.common import Q_discrete_white_noise
from filterpy.kalman import predict

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

    @cached_property
    def F(self) -> Array:  # noqa: N802 - the paper's symbol
        """State transition (4, 4)."""
        F = np.eye(4)
        F[0, 2] = F[1, 3] = self.dt
        return F

    @cached_property
    def Q(self) -> Array:  # noqa: N802 - the paper's symbol
        """Process noise (4, 4)."""
        Q = Q_discrete_white_noise(2, self.dt, self.sigma_a**2, block_size=2, order_by_dim=False)
        return np.asarray(Q, dtype=float)

    def predict(self, belief: Gaussian) -> Gaussian:
        """The belief one step later, without a measurement."""
        return Gaussian(*predict(belief.mean, belief.covariance, self.F, self.Q))
