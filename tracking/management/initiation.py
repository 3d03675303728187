"""Track initiation by m of n: from measurements that no track explains to confirmed tracks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tracking.filter.kalman import Gaussian, innovation, update
from tracking.filter.motion import MotionModel
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.assignment import pairs_within
from tracking.numerics.distances import squared_distance

# Flags (T, K) of visible samples of beliefs, means (T, 4) and covariances (T, 4, 4).
VisibleSamples = Callable[[Array, Array], Flags]


@dataclass(frozen=True, eq=False)
class Tentative:
    """Tentative track; its first measurement counts as a hit."""

    belief: Gaussian
    hits: int = 1
    scans: int = 1
    existence: float = 1.0  # probability

    def verdict(self, confirm: tuple[int, int]) -> bool | None:
        """True once it has m hits, False once it cannot reach them within its first n scans."""
        m, n = confirm
        if self.hits >= m:
            return True
        return False if self.hits + n - self.scans < m else None


@dataclass(frozen=True)
class Initiator:
    """Initiator that confirms a track with m measurements within its first n scans."""

    motion: MotionModel
    confirm: tuple[int, int]  # m of n
    gate: float  # largest squared distance between measurement and tentative track
    max_speed: float  # m/s

    def step(
        self, tentative: list[Tentative], z: Array, R: Array, *, elapsed: int, visible: VisibleSamples
    ) -> tuple[list[Tentative], list[Tentative]]:
        """Confirmed and remaining tentative tracks after a scan, `elapsed` steps of motion later.

        z (N, 2) m, R (N, 2, 2) m². Every scan counts, so `visible` is not used.
        """
        predicted = [coasted(self.motion, t.belief, elapsed) for t in tentative]
        taken = self._assign(predicted, z, R)
        grown = []
        for k, (old, belief) in enumerate(zip(tentative, predicted, strict=True)):
            j = taken.get(k)
            updated = belief if j is None else update(belief, z[j], R[j])
            grown.append(Tentative(updated, old.hits + (j is not None), old.scans + 1))
        used = set(taken.values())
        grown += [tentative_track(z[j], R[j], self.max_speed) for j in range(len(z)) if j not in used]
        verdicts = [t.verdict(self.confirm) for t in grown]
        confirmed = [t for t, verdict in zip(grown, verdicts, strict=True) if verdict]
        return confirmed, [t for t, verdict in zip(grown, verdicts, strict=True) if verdict is None]

    def _assign(self, predicted: list[Gaussian], z: Array, R: Array) -> dict[int, int]:
        """Index of the measurement of each tentative track that gets one."""
        if not predicted or len(z) == 0:
            return {}
        means = np.array([belief.mean for belief in predicted])[:, None]
        covariances = np.array([belief.covariance for belief in predicted])[:, None]
        nu = innovation(Gaussian(means, covariances), z, R)
        distance = squared_distance(nu.mean, nu.covariance)
        return dict(pairs_within(distance, self.gate))


def coasted(motion: MotionModel, belief: Gaussian, steps: int) -> Gaussian:
    """Predict a belief over several steps of motion."""
    for _ in range(steps):
        belief = motion.predict(belief)
    return belief


def tentative_track(z: Array, R: Array, max_speed: float) -> Tentative:
    """Tentative track that starts at a measurement z (2,) m with covariance R (2, 2) m².

    Its velocity is zero with the variance of velocities spread evenly up to `max_speed` m/s in all directions, a
    quarter of its square along each axis.
    """
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = R
    covariance[2, 2] = covariance[3, 3] = max_speed * max_speed / 4
    return Tentative(Gaussian(np.array([z[0], z[1], 0.0, 0.0]), covariance))
