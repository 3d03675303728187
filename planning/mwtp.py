"""The multiple weighted trace penalty (MWTP), a cost-to-go for targets that nobody sees when the horizon ends."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planning.view import inside, shortest_move
from tracking.compiled import Array, compiled


class Match(NamedTuple):
    """A target that nobody sees, and the UAV that Algorithm 2 sends to it."""

    uav: int  # row of the sensors
    target: int
    distance: float  # m, from where the camera looks after its earlier matches
    penalty: float  # m³; only the first match of a UAV has one


@compiled
def weighted_trace_penalty(targets: Array, traces: Array, sensors: Array, views: Array) -> float:
    """Multiple weighted trace penalty, [Li22] Algorithm 2 with β = 1 [m³].

    targets (T, 2 or 3) m at the end of the horizon, traces (T,) m² of their position covariance, sensors (n, 2) m,
    views (n, 5, 3): their fields of view, see `planning.view.quadrangle`. `sensors` is overwritten with the positions
    p^MDO.

    Note: distances are counted from where a camera looks, which the paper's cameras do straight down.
    Note: T is the set outside all fields of view as geometry; a target in view but hidden is not in it, because
    p^MDO, the least displacement after which the field of view covers the target, would be where the sensor is.
    """
    busy = np.zeros((len(sensors), 3))
    busy[:, :2] = sensors
    seen, order = np.zeros(len(targets), dtype=np.bool_), np.arange(len(targets))
    for i in range(len(sensors)):
        cover(targets, seen, sensors, views, i)
    penalty, last, target = penalise(targets, traces, seen, busy, views, order)
    if last >= 0:
        _move(busy, last, targets, target, views)
    sensors[:] = busy[:, :2]
    return penalty


@compiled
def cover(targets: Array, seen: NDArray[np.bool_], sensors: Array, views: Array, uav: int) -> None:
    """Mark in `seen` (T,) the targets (T, 2 or 3) m that a UAV's sensor at (2,) m has in its field of view."""
    for t in range(len(targets)):
        if not seen[t]:
            seen[t] = inside(views, uav, targets[t, 0] - sensors[uav, 0], targets[t, 1] - sensors[uav, 1])


@compiled
def penalise(
    targets: Array, traces: Array, seen: NDArray[np.bool_], sensors: Array, views: Array, order: NDArray[np.int64]
) -> tuple[float, int, int]:
    """`weighted_trace_penalty` of targets that are not `seen` (T,); sensors (n, 3): x, y [m] and D_i, overwritten.

    order (T,): a permutation of the targets, left sorted by falling trace; one that nearly is saves time. The last
    move, of which sensor to which target (-1: none), is left to do: without further targets it changes nothing.
    """
    _sort(order, traces)
    penalty, mover, moved_to = 0.0, -1, 0
    for t in order:
        if seen[t]:
            continue
        if mover >= 0:
            _move(sensors, mover, targets, moved_to, views)
        nearest, shortest = _nearest(targets, t, sensors, views)
        if sensors[nearest, 2] == 0.0:
            penalty += shortest * traces[t]
        sensors[nearest, 2] += shortest
        mover, moved_to = nearest, t
    return penalty, mover, moved_to


def matching(targets: Array, traces: Array, seen: NDArray[np.bool_], sensors: Array, views: Array) -> tuple[Match, ...]:
    """Who is sent to whom by `penalise`, of whose arguments none is changed, in the order of the matches."""
    order = np.argsort(-traces, kind="stable")
    later, last, found = np.ones(len(targets), dtype=np.bool_), 0.0, []
    travelled = np.zeros(len(sensors))
    for t in order[~seen[order]]:
        later[t] = False
        after = np.array(sensors, dtype=float)
        total, uav, target = penalise(targets, traces, seen | later, after, views, order)
        found.append(Match(uav, target, float(after[uav, 2] - travelled[uav]), total - last))
        travelled[uav], last = after[uav, 2], total
    return tuple(found)


@compiled
def _move(sensors: Array, uav: int, targets: Array, t: int, views: Array) -> None:
    """Move a sensor to where its field of view just covers the target."""
    x, y = shortest_move(views, uav, targets[t, 0] - sensors[uav, 0], targets[t, 1] - sensors[uav, 1])
    sensors[uav, 0] += x
    sensors[uav, 1] += y


@compiled
def _sort(order: NDArray[np.int64], traces: Array) -> None:
    """Insertion sort by falling trace, equal ones by index: in linear time where `order` is nearly sorted."""
    for k in range(1, len(order)):
        t, j = order[k], k
        while j > 0:
            before = order[j - 1]
            if traces[before] > traces[t] or (traces[before] == traces[t] and before < t):
                break
            order[j] = before
            j -= 1
        order[j] = t


@compiled
def _nearest(targets: Array, t: int, sensors: Array, views: Array) -> tuple[int, float]:
    best, shortest, total = 0, 0.0, np.inf
    for i in range(len(sensors)):
        dx, dy = targets[t, 0] - sensors[i, 0] - views[i, 4, 0], targets[t, 1] - sensors[i, 1] - views[i, 4, 1]
        d = math.sqrt(dx * dx + dy * dy)
        if sensors[i, 2] + d < total:
            best, shortest, total = i, d, sensors[i, 2] + d
    return best, shortest
