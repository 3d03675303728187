"""From where UAVs get to see targets: what a search for plans may aim at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from planning.prediction.belief import Outlook
from planning.prediction.view import shortest_move
from tracking.numerics.compiled import Array, compiled


class Sights(NamedTuple):
    """What k UAVs may get into view, in the units of plans: a place is a displacement over the length of a step."""

    which: NDArray[np.int64]  # (S, 2): which of the UAVs, and after which step
    places: Array  # (S, 2) m/s: of what there is to see, from where that UAV is now
    views: Array  # (k, 5, 3): fields of view, see `planning.prediction.view.quadrangle`, with lengths in m/s


class Eased(Protocol):
    """An objective that can be made easier for a search."""

    def __call__(self, candidates: Array, ease: Array | None = None) -> Array:
        """Costs (N,) m² of candidates (N, k, H, 2) m/s.

        With `ease` (k,) m/s, if these UAVs' fields of view were wider on each side by what that is in a step.
        """
        ...


class Hints(NamedTuple):
    """What a search may make use of besides the objective."""

    eased: Eased  # the objective, and easier ones
    sights: Sights


NOTHING = Sights(np.empty((0, 2), np.int64), np.empty((0, 2)), np.empty((0, 5, 3)))


def sights(outlook: Outlook, uavs: Sequence[int], max_speeds: Array) -> Sights:
    """Every place of a target that one of the UAVs in rows `uavs` can have in view in time, hidden or not.

    max_speeds (k,) m/s. Trees are left out: whether they hide a target, the objective tells.
    """
    rows = np.asarray(uavs, dtype=np.int64)
    views = outlook.views[rows] / np.array([1.0, 1.0, outlook.step])
    return _within_reach(outlook, rows, np.ascontiguousarray(views), max_speeds)


def soonest(sights: Sights) -> Sights:
    """Those of sights that can be had after the first step."""
    first = sights.which[:, 1] == 0
    return sights._replace(which=sights.which[first], places=sights.places[first])


@compiled
def _within_reach(outlook: Outlook, uavs: NDArray[np.int64], views: Array, max_speeds: Array) -> Sights:
    points, (H, T, K) = outlook.points, outlook.points.shape[:3]
    which, places, count = np.empty((len(uavs) * H * T * K, 2), np.int64), np.empty((len(uavs) * H * T * K, 2)), 0
    for j in range(len(uavs)):
        for h in range(H):
            for t in range(T):
                for k in range(K):
                    x = (points[h, t, k, 0] - outlook.positions[uavs[j], 0]) / outlook.step
                    y = (points[h, t, k, 1] - outlook.positions[uavs[j], 1]) / outlook.step
                    dx, dy = shortest_move(views, j, x, y)
                    if dx * dx + dy * dy <= (h + 1) * max_speeds[j] * (h + 1) * max_speeds[j]:
                        which[count, 0], which[count, 1] = j, h
                        places[count, 0], places[count, 1] = x, y
                        count += 1
    return Sights(which[:count], places[:count], views)
