"""Belief propagation over a horizon: nominal trajectories ([Li22] Algorithm 1) and Monte Carlo samples."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planning.planner import Situation
from planning.prediction.predicted_belief import PredictedBelief, predict_belief
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.factorisation import eigensystems
from tracking.numerics.matrices import apply
from tracking.numerics.normal import standard_normal
from tracking.numerics.stacks import cholesky_factors
from tracking.track import beliefs_of

# Means of the five equally probable pieces of a standard normal, from the median up, scaled to a variance of one.
_FIFTHS = np.array([0.0, 0.5616259126, 1.4780312359])
# Five equally probable points with the mean (the first point) and covariance of a standard normal in the plane. Each
# piece occurs once along either axis, so that an edge of a field of view can have any number of them on one side.
_LATTICE = np.array([(0, 0), (1, -2), (2, 1), (-1, 2), (-2, -1)])
FIVE_POINTS = np.sign(_LATTICE) * _FIFTHS[np.abs(_LATTICE)]


class Propagation(Protocol):
    """Predicts a belief on targets over a horizon.

    Example:
        ```python
        from understory import Nominal

        class Cautious(Nominal):
            def predict(self, situation, horizon, rng):
                belief = super().predict(situation, horizon, rng)
                return belief._replace(covariances=2.0 * belief.covariances)
        ```
    """

    def predict(self, situation: Situation, horizon: int, rng: np.random.Generator) -> PredictedBelief:
        """Belief for `horizon` steps; each sample is a whole set of targets."""


@dataclass(frozen=True)
class Nominal:
    """Nominal belief-state optimisation (NBO): undisturbed trajectories of the means, [Li22] Algorithm 1, step 1.

    With `expected`, a target has five equally probable trajectories through its predicted beliefs rather than the mean
    trajectory alone. Each has its own visibility and trace, and the mean of the traces counts.

    Attributes:
        expected: True for five trajectories, False for that of the mean.
    """

    expected: bool = False

    def predict(self, situation: Situation, horizon: int, rng: np.random.Generator) -> PredictedBelief:
        """As `Propagation.predict`, with one sample and without random numbers."""
        means, covariances = beliefs_of(situation.tracks)
        points = np.empty((horizon, len(means), len(FIVE_POINTS) if self.expected else 1, 3))
        points[..., 2] = TARGET_HEIGHT
        points[:, :, 0, :2] = nominal_positions(situation, horizon)
        if self.expected:
            spreads, ahead, spread = np.empty((horizon, len(means), 2, 2)), means, covariances
            for step in range(horizon):
                ahead, spread = situation.motion.predict_all(ahead, spread)
                spreads[step] = spread[:, :2, :2]
            roots = cholesky_factors(spreads.reshape(-1, 2, 2)).reshape(*spreads.shape[:2], 1, 2, 2)
            points[..., :2] = points[:, :, :1, :2] + apply(roots, FIVE_POINTS)
        return predict_belief(situation, points, covariances)


@dataclass(frozen=True)
class MonteCarlo:
    """Trajectories drawn from belief and motion model; all plans are compared on the same ones (common random numbers).

    Each sample has a set of targets of its own, whose covariances evolve with the detections along their trajectories.
    Source: the multi-agent rollout that [Li22] IV-D compares with.
    """

    samples: int = 50

    def predict(self, situation: Situation, horizon: int, rng: np.random.Generator) -> PredictedBelief:
        """As `Propagation.predict`, with `samples` samples."""
        (rng,) = rng.spawn(1)  # the number of draws depends on this UAV's tracks, but must not affect the other UAVs
        means, covariances = beliefs_of(situation.tracks)
        S, T = self.samples, len(means)
        states = means + draw_deviations(covariances, rng, (S,))
        points = np.empty((horizon, S, T, 1, 3))
        points[..., 2] = TARGET_HEIGHT
        motion, spread = situation.motion, covariances
        for step in range(horizon):
            drift = _make_disturbance(motion, standard_normal(rng, (S, T, 2, 2)))
            ahead, spread = motion.predict_all(means, spread)
            pull = ahead - apply(motion.F, means)  # of the long-run velocity
            states, means = apply(motion.F, states) + drift + pull, ahead
            points[step, :, :, 0, :2] = states[..., :2]
        return predict_belief(situation, points.reshape(horizon, S * T, 1, 3), np.tile(covariances, (S, 1, 1)))


def draw_deviations(covariances: Array, rng: np.random.Generator, draws: tuple[int, ...] = ()) -> Array:
    """Deviations (*draws, T, 4) from means, drawn from covariances (T, 4, 4), which may be singular."""
    values, axes = eigensystems(np.ascontiguousarray(covariances))
    roots = axes * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return np.asarray(apply(roots, standard_normal(rng, (*draws, len(covariances), 4))))


def nominal_positions(situation: Situation, horizon: int) -> Array:
    """Undisturbed positions (H, T, 2) m of the tracks after 1 to H steps."""
    return situation.motion.positions_ahead(*beliefs_of(situation.tracks), horizon)


def _make_disturbance(motion: NearlyConstantVelocity, normal: Array) -> Array:
    """Process noise of a step on states (S, T, 4), from two normal numbers for each axis (S, T, 2, 2), x first.

    The two numbers of an axis are multiplied by the Cholesky factor of its block of Q, of rank one over a single scan.
    """
    position, both, velocity = float(motion.Q[0, 0]), float(motion.Q[0, 2]), float(motion.Q[2, 2])
    first = math.sqrt(position)
    second = both / first if first else 0.0
    rest = math.sqrt(max(velocity - second * second, 0.0)) if motion.scans > 1 else 0.0
    return np.concatenate([first * normal[..., 0], second * normal[..., 0] + rest * normal[..., 1]], axis=-1)
