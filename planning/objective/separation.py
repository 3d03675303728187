"""Separation of UAVs: a penalty on planned paths that come too near."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planning.objective.objective import Objective
from planning.planner import Situation
from planning.prediction.intent import camera_paths
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length

_PRICE = 1e6  # m² per m and step, above any gain in knowledge


@dataclass(frozen=True)
class Separation:
    """Penalty far above any gain in knowledge for plans that bring UAVs nearer than `distance` [m] in space.

    UAVs fly straight between steps. If all plans come too near, the one that keeps the most distance costs least.
    """

    distance: float

    def term(self, situation: Situation, controls: Array, uavs: Sequence[int]) -> Objective:
        """As `planning.composition.Term.term`."""
        now = np.array([v.position for v in situation.vehicles], dtype=float)
        chosen = np.asarray(uavs, dtype=np.int64)
        others = np.delete(
            np.concatenate([now[:, None], camera_paths(now, controls, situation.step)], axis=1), chosen, axis=0
        )

        def cost(candidates: Array) -> Array:
            ahead = camera_paths(now[chosen], candidates, situation.step)
            start = np.broadcast_to(now[chosen, None], (*ahead.shape[:2], 1, 3))
            own = np.concatenate([start, ahead], axis=2)
            short = np.zeros(len(own))
            for j in range(len(chosen)):
                for other in [*(other[None] for other in others), *(own[:, i] for i in range(j))]:
                    gap = _closest(own[:, j] - other)
                    short += np.maximum(self.distance - gap, 0.0).sum(axis=1)
            return _PRICE * short

        return cost


def _closest(relative: Array) -> Array:
    """Least length (N, H) m of a vector that moves linearly from each of (N, H + 1, 3) m to the next."""
    start, way = relative[:, :-1], np.diff(relative, axis=1)
    along = -(start * way).sum(axis=-1) / np.maximum((way * way).sum(axis=-1), 1e-12)
    return np.asarray(length(start + np.clip(along, 0.0, 1.0)[..., None] * way))
