"""Motion model in which speeds return to a walking speed, which is learned from the people in view."""

import math
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from tracking.filter.kalman import NearlyConstantVelocity, Transition, predict_linear
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length
from tracking.numerics.exponential import exp

_MEMORY = 3.0  # s, after which 1/e of a deviation from the walking speed is left
_SETTLED = 600.0  # s, after which each scan adds the same to the mean and covariance of a position, and nothing else


class _Scan(NamedTuple):
    """The model over one scan, for compiled code."""

    dt: float  # s
    transition: Transition  # of deviations
    Q: Array  # (4, 4)
    reversion: Transition  # of the mean velocity's deviation from the walking velocity
    walking_speed: float  # m/s


@dataclass(frozen=True)
class MeanRevertingVelocity(NearlyConstantVelocity):
    """Model in which directions persist and speeds return to a walking speed, which is learned from people in view.

    Over a scan v' = u + b (v - u) + a dt and p' = p + u dt + w (v - u) + a dt² / 2, with b = exp(-dt / 3 s) and
    w = (1 - b) 3 s. The long-run velocity u = `walking_speed` E v / √E |v|² is computed anew in each scan, and is zero
    while the direction is unknown. So deviations along the direction fade in 3 s, and those across it persist. The
    covariance treats all directions alike, and fades at the mean of the two rates, in 6 s.
    Source: [Millefiori16]. Note: the rates, and a u that follows from the belief and from detected people, are ours.

    Attributes:
        walking_speed: speed [m/s] to which people return.
        learned_in: time [s] for which people were in view, summed over people.
    """

    walking_speed: float = field(kw_only=True)
    learned_in: float = field(default=20.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.walking_speed < math.inf:
            raise ValueError(f"walking_speed must be 0 or more and finite, is {self.walking_speed}")

    @cached_property
    def transition(self) -> Transition:
        """As `NearlyConstantVelocity.transition`, for deviations from the mean."""
        return _make_reversion(self.dt, 2.0 * _MEMORY)

    @cached_property
    def Q(self) -> Array:
        """As `NearlyConstantVelocity.Q`."""
        return np.asarray(self.predict_all(np.zeros((1, 4)), np.zeros((1, 4, 4)))[1][0])

    @cached_property
    def _scan(self) -> _Scan:
        return _make_scan(self.dt / self.scans, self.sigma_a)._replace(walking_speed=self.walking_speed)

    def learn(self, velocities: Array) -> "MeanRevertingVelocity":
        """The model after a scan in which people of these velocities (N, 2) m/s were detected.

        The walking speed is the mean of all detected speeds and of the initial value, which counts as much as a person
        detected in each scan for 20 s.
        """
        dt = self.dt / self.scans
        learned_in = self.learned_in + dt * len(velocities)
        way = self.learned_in * self.walking_speed + dt * float(length(velocities).sum())
        return MeanRevertingVelocity(
            self.dt, self.sigma_a, scans=self.scans, walking_speed=way / learned_in, learned_in=learned_in
        )

    def predict_all(self, means: Array, covariances: Array) -> tuple[Array, Array]:
        """Predict a stack of beliefs one step ahead: means (T, 4), covariances (T, 4, 4)."""
        scans = min(self.scans, math.ceil(_SETTLED * self.scans / self.dt))
        means, covariances = np.ascontiguousarray(means), np.ascontiguousarray(covariances)
        means, covariances = _predict_scans(means, covariances, scans, self._scan)
        if scans < self.scans:
            moved, spread = _predict_scans(means, covariances, 1, self._scan)
            means[:, :2] += (self.scans - scans) * (moved - means)[:, :2]
            covariances[:, :2, :2] += (self.scans - scans) * (spread - covariances)[:, :2, :2]
        return means, covariances

    def positions_ahead(self, means: Array, covariances: Array, steps: int) -> Array:
        """As `NearlyConstantVelocity.positions_ahead`."""
        ahead = np.empty((steps, len(means), 2))
        for step in range(steps):
            means, covariances = self.predict_all(means, covariances)
            ahead[step] = means[:, :2]
        return ahead


def make_mean_reverting_model(
    dt: float, sigma_a: float, max_speed: float, walking_speed: float
) -> MeanRevertingVelocity:
    """The model with the arguments that `motion.MOTION_MODELS` passes; the largest speed is not used."""
    return MeanRevertingVelocity(dt, sigma_a, walking_speed=walking_speed)


@cache  # because a model that learns is made anew in each scan
def _make_scan(dt: float, sigma_a: float) -> _Scan:
    """The model over a scan of `dt` s, without its walking speed."""
    Q = NearlyConstantVelocity(dt, sigma_a).Q
    return _Scan(dt, _make_reversion(dt, 2.0 * _MEMORY), Q, _make_reversion(dt, _MEMORY), math.nan)


def _make_reversion(dt: float, memory: float) -> Transition:
    """Transition over `dt` s of a deviation of velocity that fades in `memory` s."""
    left = exp(-dt / memory)
    return Transition(memory * (1.0 - left), left)


@compiled
def _predict_scans(means: Array, covariances: Array, scans: int, scan: _Scan) -> tuple[Array, Array]:
    """Means (T, 4) and covariances (T, 4, 4) of beliefs `scans` scans later."""
    way, left = scan.reversion
    for _ in range(scans):
        moved, spread = predict_linear(means, covariances, scan.transition, scan.Q)
        for t in range(len(means)):
            x, y = means[t, 2], means[t, 3]
            square = x * x + y * y + covariances[t, 2, 2] + covariances[t, 3, 3]
            share = scan.walking_speed / math.sqrt(square) if square > 0.0 else 0.0  # u over E v
            for i in range(2):
                moved[t, i] = means[t, i] + (way + (scan.dt - way) * share) * means[t, 2 + i]
                moved[t, 2 + i] = (left + (1.0 - left) * share) * means[t, 2 + i]
        means, covariances = moved, spread
    return means, covariances
