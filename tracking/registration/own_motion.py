"""Motion of a UAV as its believed positions show it: velocity and acceleration, turns at once, and lost fixes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tracking.navigation import POSITION_TIME, Navigation
from tracking.numerics.arrays import Array
from tracking.numerics.exponential import exp, log
from tracking.numerics.matrices import product

_ACCELERATION = 3.0  # m/s², deviation along an axis, of a quadrotor that tilts by 17 degrees
_ACCELERATION_TIME = 1.0  # s, time constant of the acceleration
_SPEED = 5.0  # m/s, deviation of an unknown velocity along an axis: the default limit of commands
_TURNS, _TURNS_TIME = 0.1, 10.0  # velocity changes at once, and seconds, as if observed before the flight
_JUMP = 2.0  # m, deviation of a jump along an axis: the difference of two fixes of 1.5 m, as `gnss` has
_JUMPS = 1.0 / POSITION_TIME  # 1/s, rate of jumps: one in the time in which a position forgets its drift
_SPEED_TIME = 4.0  # s over which the speed is compared with what noise alone shows


class Odds(NamedTuple):
    """Probabilities of how a believed position differs from its prediction; without both, by noise and acceleration."""

    turn: float  # the velocity changed at once, as that of kinematic UAVs does
    jump: float  # the position jumped, as after a lost fix


class Jump(NamedTuple):
    """A jump of the believed position, if there was one."""

    size: Array  # (2,) m
    variance: float  # m², of the size along each axis


@dataclass(frozen=True, eq=False)
class OwnMotion:
    """Kalman filter of a UAV's place, velocity and acceleration, the same along both axes, predicted to a scan.

    The acceleration is a first-order Gauss-Markov process [Singer70], constant between scans. A prediction is
    independent of the noise of the position that follows, so velocity is a regressor for offsets of the clock.
    A camera that hovers does not have the velocities of this process: `reliability` tells how much of the estimated
    speeds is more than noise.
    """

    navigation: Navigation
    mean: Array  # (3, 2) m, m/s and m/s²
    covariance: Array  # (3, 3)
    of_noise: Array  # (3, 3), covariance of `mean` if the UAV hovers
    elapsed: float = 0.0  # s since the last position
    time: float = 0.0  # s since the first one
    turns: float = 0.0  # expected number of turns at once since then
    squares: float = 0.0  # m²/s², recent mean square of the predicted velocity along an axis
    squares_of_noise: float = 0.0  # m²/s², the same of a UAV that hovers

    @classmethod
    def start(cls, place: Array, navigation: Navigation) -> OwnMotion:
        """Motion after the first position (2,) m."""
        noise = navigation.horizontal_noise**2
        mean = np.vstack([place, np.zeros((2, 2))])
        return cls(navigation, mean, np.diag([noise, _SPEED**2, _ACCELERATION**2]), np.diag([noise, 0.0, 0.0]))

    @property
    def reliability(self) -> float:
        """Share of the variance of predicted velocities that is not noise, in [0, 1]: the reliability ratio [Fuller87].

        The expected velocity is the predicted one times this share.
        """
        return max(1.0 - self.squares_of_noise / self.squares, 0.0) if self.squares > 0.0 else 1.0

    def predict(self, elapsed: float) -> OwnMotion:
        """Predict by `elapsed` s."""
        kept = exp(-elapsed / _ACCELERATION_TIME)
        F = np.array([[1.0, elapsed, 0.5 * elapsed**2 * kept], [0.0, 1.0, elapsed * kept], [0.0, 0.0, kept]])
        new = np.array([[0.5 * elapsed**2], [elapsed], [1.0]])
        drift = np.diag([self.navigation.horizontal_drift**2 * (1.0 - self.navigation.kept(elapsed)[0] ** 2), 0.0, 0.0])
        mean, of_noise = product(F, self.mean), product(product(F, self.of_noise), F.T) + drift
        square = 0.5 * float(np.sum(np.square(mean[1])))
        share = min(elapsed / min(self.time, _SPEED_TIME), 1.0) if self.time > 0.0 else 0.0  # two positions show it
        return replace(
            self,
            mean=mean,
            covariance=product(product(F, self.covariance), F.T)
            + _ACCELERATION**2 * (1.0 - kept * kept) * product(new, new.T)
            + drift,
            of_noise=of_noise,
            elapsed=elapsed,
            time=self.time + elapsed,
            squares=self.squares + share * (square - self.squares),
            squares_of_noise=self.squares_of_noise + share * (float(of_noise[1, 1]) - self.squares_of_noise),
        )

    def find_jump(self, place: Array) -> Jump:
        """The jump that would have led to a position (2,) m."""
        variance = self._find_variance()
        share = _JUMP**2 / (_JUMP**2 + variance)
        return Jump(share * (place - self.mean[0]), share * variance)

    def judge(self, place: Array, jump_ratio: float = 0.0) -> Odds:
        """Odds of a position (2,) m.

        jump_ratio: logarithm of the likelihood of everything else after the jump, less that without the jump.
        """
        rate = (_TURNS + self.turns) / (_TURNS_TIME + self.time)
        variance, square = self._find_variance(), float(np.sum(np.square(place - self.mean[0])))
        steady = _find_log_density(square, variance)
        turn = log(rate * self.elapsed) + _find_log_density(square, variance + (_SPEED * self.elapsed) ** 2)
        jump = log(_JUMPS * self.elapsed) + _find_log_density(square, variance + _JUMP**2) + jump_ratio
        top = max(steady, turn, jump)
        steady, turn, jump = (exp(max(density - top, -700.0)) for density in (steady, turn, jump))
        whole = steady + turn + jump
        # Without evidence for it, a jump is none: its prior would only widen the error of the position.
        return Odds(turn / whole, jump / whole if jump > _JUMPS * self.elapsed * whole else 0.0)

    def find_velocity_variance(self, odds: Odds) -> float:
        """Variance [m²/s²] along an axis of the velocity, about the predicted one times the reliability."""
        return self.reliability * (float(self.covariance[1, 1]) + odds.turn * _SPEED**2)

    def update(self, place: Array, odds: Odds) -> OwnMotion:
        """Update by the position (2,) m, to which the motion is predicted."""
        turn, noise = np.array([[self.elapsed], [1.0], [0.0]]), self.navigation.horizontal_noise**2
        P = self.covariance + odds.turn * _SPEED**2 * product(turn, turn.T)
        P[0, 0] += odds.jump * _JUMP**2
        gain = P[:, :1] / (P[0, 0] + noise)
        left = np.eye(3)
        left[:, :1] -= gain
        of_measurement = noise * product(gain, gain.T)
        return replace(
            self,
            mean=self.mean + gain * (place - self.mean[0]),
            covariance=product(product(left, P), left.T) + of_measurement,
            of_noise=product(product(left, self.of_noise), left.T) + of_measurement,
            turns=self.turns + odds.turn,
        )

    def _find_variance(self) -> float:
        """Variance of a position along each axis, as predicted."""
        return float(self.covariance[0, 0]) + self.navigation.horizontal_noise**2


def _find_log_density(square: float, variance: float) -> float:
    """Logarithm of a Gaussian density in two dimensions, but for a constant; square of the distance, variance."""
    return -0.5 * square / variance - log(variance)
