"""Targets that UAVs can bring into view within the horizon: hints for a search over plans."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planning.prediction.predicted_belief import PredictedBelief
from planning.prediction.quadrangle import shortest_move
from planning.prediction.response import Response
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled


class TargetsInReach(NamedTuple):
    """Targets that k UAVs can bring into view; lengths are divided by the length of a step, as in plans."""

    rows: Indices  # (S,): row of the UAV
    steps: Indices  # (S,): step after which it can
    places: Array  # (S, 2) m/s: position of the target relative to the present position of that UAV
    views: Array  # (k, 5, 3): fields of view, see `field_of_view.view_quadrangle`, with lengths in m/s
    response: Response  # of the UAVs to commands


_NONE = np.empty(0, np.int64)
_NOBODY = Response(np.empty((0, 2)), np.empty(0), np.empty(0))
NO_TARGETS = TargetsInReach(_NONE, _NONE, np.empty((0, 2)), np.empty((0, 5, 3)), _NOBODY)


def find_targets_in_reach(
    belief: PredictedBelief, uavs: Sequence[int], max_speeds: Array, response: Response
) -> TargetsInReach:
    """Predicted positions of targets that a UAV in rows `uavs` can reach with its field of view in time.

    max_speeds (k,) m/s. Trees and the time to gain speed are left out here; the objective accounts for them.
    """
    deciding = np.asarray(uavs, dtype=np.int64)
    views = np.ascontiguousarray(belief.views[deciding] / np.array([1.0, 1.0, belief.step]))
    return TargetsInReach(*_list_in_reach(belief, deciding, views, max_speeds), views, response)


@compiled
def _list_in_reach(
    belief: PredictedBelief, uavs: Indices, views: Array, max_speeds: Array
) -> tuple[Indices, Indices, Array]:
    """Rows (S,), steps (S,) and places (S, 2) m/s of `TargetsInReach`."""
    points, (H, T, K) = belief.points, belief.points.shape[:3]
    most, count = len(uavs) * H * T * K, 0
    rows, steps, places = np.empty(most, np.int64), np.empty(most, np.int64), np.empty((most, 2))
    for j in range(len(uavs)):
        for h in range(H):
            for t in range(T):
                for k in range(K):
                    x = (points[h, t, k, 0] - belief.positions[uavs[j], 0]) / belief.step
                    y = (points[h, t, k, 1] - belief.positions[uavs[j], 1]) / belief.step
                    dx, dy = shortest_move(views, j, x, y)
                    if dx * dx + dy * dy <= (h + 1) * max_speeds[j] * (h + 1) * max_speeds[j]:
                        rows[count], steps[count] = j, h
                        places[count, 0], places[count, 1] = x, y
                        count += 1
    return rows[:count], steps[:count], places[:count]
