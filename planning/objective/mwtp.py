"""The multiple weighted trace penalty (MWTP): the cost-to-go of targets outside all fields of view at the end."""

import math

import numpy as np

from planning.prediction.predicted_belief import LANES
from planning.prediction.quadrangle import inside, shortest_move
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, merged


@compiled
def add_penalties(
    targets: Array, traces: Array, seen: Flags, ends: Array, uavs: Indices, own: Array, views: Array, sums: Array
) -> None:
    """Add the MWTP of targets at the end of the horizon to sums, by Algorithm 2.

    Source: [Li22], with β = 1.

    Note: distances are counted from the aim point of a camera; the paper's cameras look straight down.
    Note: a target that is in a field of view but hidden gets no match, because its p^MDO, the least displacement after
    which the field of view covers it, would be zero.

    targets (T, 2 or 3) m; traces (T, LANES) m² of their position covariances; seen (T,): flags of targets in view of
    UAVs that do not decide; ends (n, 2) m: places of those UAVs; own (k, 2, LANES) m: places of the UAVs that decide,
    in rows `uavs`; views (n, 5, 3) as in `field_of_view.view_quadrangle`; sums (LANES,) are changed in place.
    """
    unseen, left, sensors = np.empty((len(targets), LANES)), np.empty((len(targets), 3)), np.empty((len(ends), 3))
    for t in range(len(targets)):
        unseen[t, :] = 0.0 if seen[t] else 1.0
        for j in range(len(uavs)):
            _mark_in_view(unseen[t], targets[t], own[j], views[uavs[j]])
    for lane in range(LANES):
        count = _list_unseen(unseen, targets, traces, lane, left)
        if count > 0:
            for i in range(len(ends)):
                sensors[i, 0], sensors[i, 1], sensors[i, 2] = ends[i, 0], ends[i, 1], 0.0
            for j in range(len(uavs)):
                sensors[uavs[j], 0], sensors[uavs[j], 1] = own[j, 0, lane], own[j, 1, lane]
            sums[lane] = _match(left, count, sensors, views, sums[lane])


@merged
def _mark_in_view(unseen: Array, target: Array, cameras: Array, view: Array) -> None:
    """Set `unseen` (LANES,) to 0 where cameras (2, LANES) m have a target in their field of view."""
    east, north = cameras[0], cameras[1]
    for lane in range(LANES):
        unseen[lane] = 0.0 if inside(view, target[0] - east[lane], target[1] - north[lane]) else unseen[lane]


@merged
def _list_unseen(unseen: Array, targets: Array, traces: Array, lane: int, left: Array) -> int:
    """Count the unseen targets in a lane, and write their x, y [m] and trace [m²] to `left` (T, 3) by falling trace."""
    count = 0
    for t in range(len(targets)):
        if unseen[t, lane] > 0.0:
            m, trace = count, traces[t, lane]
            while m > 0 and left[m - 1, 2] < trace:
                left[m, 0], left[m, 1], left[m, 2] = left[m - 1, 0], left[m - 1, 1], left[m - 1, 2]
                m -= 1
            left[m, 0], left[m, 1], left[m, 2] = targets[t, 0], targets[t, 1], trace
            count += 1
    return count


@merged
def _match(left: Array, count: int, sensors: Array, views: Array, total: float) -> float:
    """`total` with the penalties of targets in the first rows of `left`; sensors (n, 3): x, y [m] and D_i, change."""
    free = len(sensors)  # sensors without a match yet: only the first match of a sensor has a penalty
    for m in range(count):
        x, y, nearest, distance, least = left[m, 0], left[m, 1], 0, 0.0, np.inf
        for i in range(len(sensors)):
            dx, dy = x - sensors[i, 0] - views[i, 4, 0], y - sensors[i, 1] - views[i, 4, 1]
            d = math.sqrt(dx * dx + dy * dy)
            if sensors[i, 2] + d < least:
                nearest, distance, least = i, d, sensors[i, 2] + d
        if sensors[nearest, 2] == 0.0:
            total, free = total + distance * left[m, 2], free - 1
        if free == 0 or m + 1 == count:
            break
        sensors[nearest, 2] += distance
        dx, dy = shortest_move(views, nearest, x - sensors[nearest, 0], y - sensors[nearest, 1])  # to p^MDO
        sensors[nearest, 0] += dx
        sensors[nearest, 1] += dy
    return total
