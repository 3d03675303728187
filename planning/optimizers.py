"""Optimisers over one UAV's plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tracking.compiled import Array

Objective = Callable[[Array], Array]  # candidates (N, H, 2) m/s -> costs (N,)


@dataclass(frozen=True)
class CrossEntropy:
    """Cross-entropy search whose elites survive: never worse than the best plan it is given.

    Each round draws plans round the elites with noise that is correlated in time (a UAV rarely profits from zigzag)
    and shrinks from round to round; elites compete with the new plans. Plans of several basins live on side by side,
    which a single Gaussian, as in textbook CEM, would average. Source: [Pinneri20] for elites and coloured noise.
    """

    population: int = 256
    elites: int = 16
    rounds: int = 8
    spread: float = 0.5  # of the maximum speed, at first
    shrink: float = 0.65  # of the spread, per round

    def minimise(self, objective: Objective, starts: Array, max_speed: float, rng: np.random.Generator) -> Array:
        """The best plan (H, 2) m/s found from `starts` (S, H, 2) m/s within the speed limit."""
        pool = limited(starts, max_speed)
        values = objective(pool)
        spread = self.spread * max_speed
        for _ in range(self.rounds):
            order = np.argsort(values, kind="stable")[: self.elites]
            pool, values = pool[order], values[order]
            parents = pool[rng.integers(len(pool), size=self.population)]
            drawn = limited(parents + spread * _correlated(parents.shape, rng), max_speed)
            pool, values = np.concatenate([pool, drawn]), np.concatenate([values, objective(drawn)])
            spread *= self.shrink
        return np.asarray(pool[np.argmin(values)])


def limited(plans: Array, max_speed: float) -> Array:
    """Plans (N, H, 2) m/s, each control shortened to the speed limit."""
    speed = np.linalg.norm(plans, axis=-1, keepdims=True)
    return np.asarray(plans * np.minimum(1.0, max_speed / np.maximum(speed, 1e-12)))


def _correlated(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Noise (N, H, 2): a constant offset and white noise over the steps, of equal variance, unit in total."""
    constant = rng.standard_normal((shape[0], 1, shape[2]))
    return np.asarray((constant + rng.standard_normal(shape)) / np.sqrt(2))
