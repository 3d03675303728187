"""Gaussian beliefs, the nearly constant velocity model, and the prediction of the Kalman filter."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled

# Process noise (2, 2) of position and velocity in one dimension, [Li22] eq. (1), for an acceleration of variance
# 1 m²/s⁴ that is constant over a step of 1 s. The model scales it to other steps.
_UNIT_NOISE = np.outer([0.5, 1.0], [0.5, 1.0])


@dataclass(frozen=True, eq=False)
class Gaussian:
    """Belief on a target's state (px, py, vx, vy) in m and m/s, as in [Li22] eq. (1).

    Attributes:
        mean: (4,) m and m/s.
        covariance: (4, 4) m², m²/s and m²/s².
    """

    mean: Array
    covariance: Array


class Transition(NamedTuple):
    """How a deviation from the mean moves on over a step: F = [[I, way I], [0, left I]]."""

    way: float  # s, displacement per initial velocity
    left: float  # share of the initial velocity that is left after the step


@dataclass(frozen=True)
class NearlyConstantVelocity:
    """The motion model of [Li22] eq. (1), over one or more scans.

    The acceleration is constant over each of `scans` equal parts of `dt`, and independent between parts. A step has the
    same moments as `scans` steps of dt / scans.

    Attributes:
        dt: duration of a step [s].
        sigma_a: standard deviation of the acceleration [m/s²].
        scans: number of equal parts of a step.
    """

    dt: float
    sigma_a: float
    scans: int = field(default=1, kw_only=True)

    def __post_init__(self) -> None:
        if not 0.0 < self.dt < math.inf:
            raise ValueError(f"dt must be positive and finite, is {self.dt}")
        if not 0.0 <= self.sigma_a < math.inf:
            raise ValueError(f"sigma_a must be 0 or more and finite, is {self.sigma_a}")
        if not (isinstance(self.scans, int | np.integer) and self.scans >= 1):
            raise ValueError(f"scans must be an integer, 1 or more, is {self.scans}")

    @property
    def transition(self) -> Transition:
        """Transition over one step."""
        return Transition(self.dt, 1.0)

    @property
    def F(self) -> Array:
        """State transition (4, 4) of deviations from the mean."""
        way, left = self.transition
        return np.kron(np.array([[1.0, way], [0.0, left]]), np.eye(2))

    @cached_property
    def Q(self) -> Array:
        """Process noise (4, 4): over n scans Σ Fᵏ Q F'ᵏ for k from 0 to n - 1, with F and Q of one scan."""
        n, dt = self.scans, self.dt / self.scans
        square = dt * dt
        variance = self.sigma_a * self.sigma_a
        position = variance * (n * (4 * n * n - 1) // 3 * square * square)
        both, velocity = variance * (n * n * dt * square), variance * (n * square)
        return np.kron(_UNIT_NOISE * np.array([[position, both], [both, velocity]]), np.eye(2))

    def predict(self, belief: Gaussian) -> Gaussian:
        """Predict a belief one step ahead."""
        means, covariances = self.predict_all(belief.mean[None], belief.covariance[None])
        return Gaussian(means[0], covariances[0])

    def predict_all(self, means: Array, covariances: Array) -> tuple[Array, Array]:
        """Predict a stack of beliefs one step ahead: means (T, 4), covariances (T, 4, 4)."""
        return predict_linear(np.ascontiguousarray(means), np.ascontiguousarray(covariances), self.transition, self.Q)

    def stretch(self, duration: float) -> "NearlyConstantVelocity":
        """The model over `duration` s, in equal parts of about the length of a scan.

        The variance of velocities grows as fast as before, σ² dt per second with the dt of a scan. So the model over a
        whole number of scans has the moments of as many scans.
        """
        dt = self.dt / self.scans
        scans = max(round(duration / dt), 1)
        sigma_a = self.sigma_a * math.sqrt(scans * dt / duration)
        return replace(self, dt=duration, scans=scans, sigma_a=sigma_a)

    def positions_ahead(self, means: Array, covariances: Array, steps: int) -> Array:
        """Positions (H, T, 2) m of the means (T, 4) of beliefs after 1 to H steps."""
        return np.asarray(means[:, :2] + self.dt * np.arange(1, steps + 1)[:, None, None] * means[:, 2:])


def make_ncv_model(dt: float, sigma_a: float, max_speed: float, walking_speed: float) -> NearlyConstantVelocity:
    """The model with the arguments that `motion.MOTION_MODELS` passes; the speeds are not used."""
    return NearlyConstantVelocity(dt, sigma_a)


@compiled
def predict_linear(means: Array, covariances: Array, transition: Transition, Q: Array) -> tuple[Array, Array]:
    """F ξ (T, 4) and the symmetric F P Fᵀ + Q (T, 4, 4), where F = [[I, w I], [0, l I]] by `transition`."""
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
