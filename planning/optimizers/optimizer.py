"""The interface of optimisers over the plans of one or more UAVs."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from planning.objective.objective import Objective
from planning.prediction.targets_in_reach import Hints
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length


class SearchResult(NamedTuple):
    """The best plans of a search, their cost and the number of evaluations."""

    plans: Array  # (k, H, 2) m/s
    cost: float
    evaluations: int


class Optimizer(Protocol):
    """Searches plans of k UAVs; never worse than the best start."""

    def minimise(
        self,
        objective: Objective,
        starts: Array,
        max_speeds: Array,
        rng: np.random.Generator,
        hints: Hints | None = None,
    ) -> SearchResult:
        """The best plans found from `starts` (S, k, H, 2) m/s, each control within `max_speeds` (k,) m/s.

        An optimiser may use the hints or ignore them.
        """
        ...


def speed_limited(plans: Array, max_speeds: Array | float) -> Array:
    """Plans (..., k, H, 2) m/s, each control shortened to the speed limit of its UAV, (k,) or one for all [m/s]."""
    speed = length(plans)[..., None]
    most = np.reshape(max_speeds, (-1, 1, 1))
    return np.asarray(plans * np.minimum(1.0, most / np.maximum(speed, 1e-12)))
