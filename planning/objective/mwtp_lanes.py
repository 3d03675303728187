"""The multiple weighted trace penalty (MWTP): the cost-to-go of targets outside all fields of view at the end.

Many plans are computed side by side, in lanes, with the processor's vector instructions.
"""

import math
from typing import NamedTuple

import numpy as np

from planning.prediction.predicted_belief import LANES
from planning.prediction.quadrangle import corner, inside
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled

Pair = tuple[float, float]
Triple = tuple[float, float, float]


class Workspace(NamedTuple):
    """Arrays that `add_penalties` works on, allocated once: n UAVs, T targets."""

    unseen: Array  # (T, LANES): 1 for a target outside all fields of view, else 0
    order: Indices  # (T,): the targets by falling trace
    targets: Array  # (3, T, LANES): x, y [m] and trace [m²] of the unseen targets, in that order
    counts: Array  # (LANES,): number of unseen targets
    sensors: Array  # (n, 3, LANES): x, y [m] and D_i
    match: Array  # (3, LANES): row of the sensor, its distance [m], and D_i plus this distance


@compiled
def make_workspace(targets: int, uavs: int) -> Workspace:
    """Workspace for a number of targets and UAVs."""
    return Workspace(
        np.empty((targets, LANES)),
        np.arange(targets),
        np.empty((3, targets, LANES)),
        np.empty(LANES),
        np.empty((uavs, 3, LANES)),
        np.empty((3, LANES)),
    )


@compiled
def add_penalties(work: Workspace, targets: Array, traces: Array, views: Array, sums: Array) -> None:
    """Add the MWTP of the targets that are `work.unseen` to `sums` (LANES,), by Algorithm 2.

    targets (T, 2 or 3) m at the end of the horizon; traces (T, LANES) m² of their position covariances; views (n, 5, 3)
    as in `field_of_view.view_quadrangle`. The sensors in `work.sensors` have D_i of 0 at first, and are moved to p^MDO.
    Source: [Li22], with β = 1.

    Note: distances are counted from the aim point of a camera; the paper's cameras look straight down.
    Note: a target that is in a field of view but hidden gets no match, because its p^MDO, the least displacement after
    which the field of view covers it, would be zero.
    """
    _sort(work, targets, traces)
    most = int(work.counts.max())
    for m in range(most):
        _match(work, m, views)
        for i in range(len(work.sensors)):
            _assign(work, m, i, sums)
            if m + 1 < most:
                _move(work, m, i, views)


@compiled
def mark_in_view(targets: Array, seen: Flags, sensors: Array, views: Array, uav: int) -> None:
    """Mark in `seen` (T,) the targets (T, 2 or 3) m in the field of view of a UAV's sensor at (2,) m."""
    for t in range(len(targets)):
        if not seen[t]:
            seen[t] = inside(views[uav], targets[t, 0] - sensors[uav, 0], targets[t, 1] - sensors[uav, 1])


@compiled
def mark_in_view_lanes(work: Workspace, targets: Array, uav: int, views: Array) -> None:
    """Mark targets (T, 2 or 3) m in the field of view of a UAV as seen; `mark_in_view` lane by lane."""
    view, east, north = views[uav], work.sensors[uav, 0], work.sensors[uav, 1]
    for t in range(len(targets)):
        x, y, unseen = targets[t, 0], targets[t, 1], work.unseen[t]
        for lane in range(LANES):
            unseen[lane] = 0.0 if inside(view, x - east[lane], y - north[lane]) else unseen[lane]


@compiled
def _sort(work: Workspace, targets: Array, traces: Array) -> None:
    """List the unseen targets of each lane by falling trace, equal ones by index.

    Insertion sort takes linear time where the order in a lane is nearly that in the lane before.
    """
    order = work.order
    for lane in range(LANES):
        for k in range(1, len(order)):
            t, j = order[k], k
            while j > 0:
                before = order[j - 1]
                if traces[before, lane] > traces[t, lane] or (traces[before, lane] == traces[t, lane] and before < t):
                    break
                order[j] = before
                j -= 1
            order[j] = t
        count = 0
        for t in order:
            if work.unseen[t, lane] > 0.0:
                work.targets[0, count, lane], work.targets[1, count, lane] = targets[t, 0], targets[t, 1]
                work.targets[2, count, lane] = traces[t, lane]
                count += 1
        work.counts[lane] = count
        for m in range(count, len(order)):
            work.targets[:, m, lane] = 0.0


@compiled
def _match(work: Workspace, m: int, views: Array) -> None:
    """Match the m-th target of each lane with the sensor of least D_i plus distance; -1 if there is no such target."""
    x, y = work.targets[0, m], work.targets[1, m]
    row, shortest, total = work.match[0], work.match[1], work.match[2]
    for lane in range(LANES):
        total[lane] = np.inf
    for i in range(len(work.sensors)):
        east, north, travelled = work.sensors[i, 0], work.sensors[i, 1], work.sensors[i, 2]
        aim_x, aim_y = views[i, 4, 0], views[i, 4, 1]
        for lane in range(LANES):
            dx, dy = x[lane] - east[lane] - aim_x, y[lane] - north[lane] - aim_y
            d = math.sqrt(dx * dx + dy * dy)
            better = travelled[lane] + d < total[lane]
            row[lane] = i if better else row[lane]
            shortest[lane] = d if better else shortest[lane]
            total[lane] = travelled[lane] + d if better else total[lane]
    for lane in range(LANES):
        row[lane] = row[lane] if m < work.counts[lane] else -1.0


@compiled
def _assign(work: Workspace, m: int, i: int, sums: Array) -> None:
    """Add the penalty and distance of sensor i in the lanes where it is matched; only its first match has a penalty."""
    row, shortest, trace, travelled = work.match[0], work.match[1], work.targets[2, m], work.sensors[i, 2]
    for lane in range(LANES):
        mine = row[lane] == i
        sums[lane] += shortest[lane] * trace[lane] if mine & (travelled[lane] == 0.0) else 0.0
        travelled[lane] += shortest[lane] if mine else 0.0


@compiled
def _move(work: Workspace, m: int, i: int, views: Array) -> None:
    """Move sensor i by `quadrangle.shortest_move` in the lanes where it is matched."""
    x, y, row, east, north = (
        work.targets[0, m],
        work.targets[1, m],
        work.match[0],
        work.sensors[i, 0],
        work.sensors[i, 1],
    )
    one = views[i, 0, 0], views[i, 0, 1], views[i, 0, 2]
    two = views[i, 1, 0], views[i, 1, 1], views[i, 1, 2]
    three = views[i, 2, 0], views[i, 2, 1], views[i, 2, 2]
    four = views[i, 3, 0], views[i, 3, 1], views[i, 3, 2]
    corners = corner(views, i, 0), corner(views, i, 1), corner(views, i, 2), corner(views, i, 3)
    for lane in range(LANES):
        offset = x[lane] - east[lane], y[lane] - north[lane]
        # Displacement from the nearest corner, or from the foot on the first side that has its foot between its ends.
        best = _subtract(offset, corners[0])
        best = _choose_shorter(best, _subtract(offset, corners[1]))
        best = _choose_shorter(best, _subtract(offset, corners[2]))
        best = _choose_shorter(best, _subtract(offset, corners[3]))
        best = _find_foot(best, offset, four, (one, two, three))
        best = _find_foot(best, offset, three, (one, two, four))
        best = _find_foot(best, offset, two, (one, three, four))
        best = _find_foot(best, offset, one, (two, three, four))
        outside = (
            _is_beyond(offset, one) | _is_beyond(offset, two) | _is_beyond(offset, three) | _is_beyond(offset, four)
        )
        go = (row[lane] == i) & outside
        east[lane] += best[0] if go else 0.0
        north[lane] += best[1] if go else 0.0


@compiled
def _is_beyond(point: Pair, side: Triple) -> bool:
    return not (side[0] * point[0] + side[1] * point[1] <= side[2])


@compiled
def _subtract(point: Pair, other: Pair) -> Pair:
    return point[0] - other[0], point[1] - other[1]


@compiled
def _choose_shorter(one: Pair, other: Pair) -> Pair:
    closer = other[0] * other[0] + other[1] * other[1] < one[0] * one[0] + one[1] * one[1]
    return other[0] if closer else one[0], other[1] if closer else one[1]


@compiled
def _find_foot(best: Pair, point: Pair, side: Triple, others: tuple[Triple, Triple, Triple]) -> Pair:
    """Displacement to a point outside a side from its foot, if the foot lies between the side's ends, else `best`."""
    excess = side[0] * point[0] + side[1] * point[1] - side[2]
    foot = point[0] - excess * side[0], point[1] - excess * side[1]
    off = _is_beyond(foot, others[0]) | _is_beyond(foot, others[1]) | _is_beyond(foot, others[2])
    on = (excess > 0.0) & (not off)
    return excess * side[0] if on else best[0], excess * side[1] if on else best[1]
