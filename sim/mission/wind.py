"""Wind: a mean velocity and seeded gusts, the same for the whole fleet."""

import math

import numpy as np

from sim.scenario.environment import Wind
from tracking.numerics.arrays import Array
from tracking.numerics.exponential import exp
from tracking.numerics.normal import standard_normal


class Air:
    """The velocity of the air at each physics step: first-order Gauss-Markov gusts around the mean.

    The two components are independent, with the scenario's standard deviation and correlation time. The process starts
    in its steady state and is discretised exactly, so that its statistics do not depend on the rate. All UAVs meet the
    same gust at the same time, because eddies that last for seconds are larger than a fleet.
    """

    def __init__(self, wind: Wind, rate: int, rng: np.random.Generator) -> None:
        self._wind = wind
        self._kept = exp(-1.0 / (rate * wind.gust_time))
        self._rng = rng
        self._gust = wind.gust * standard_normal(rng, 2)

    def steps(self, count: int) -> Array:
        """Velocities (count, 2) m/s of the air, east and north, in the next physics steps."""
        drawn = self._wind.gust * math.sqrt(1.0 - self._kept * self._kept) * standard_normal(self._rng, (count, 2))
        gusts = np.empty((count, 2))
        for k in range(count):
            gusts[k] = self._gust
            self._gust = self._kept * self._gust + drawn[k]
        return np.asarray(gusts + self._wind.velocity)
