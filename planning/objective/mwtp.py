"""The multiple weighted trace penalty (MWTP): the cost-to-go of targets outside all fields of view at the end."""

from typing import NamedTuple

import numpy as np

from planning.prediction.quadrangle import inside, shortest_move
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length


class Match(NamedTuple):
    """A target outside all fields of view, and the UAV that Algorithm 2 assigns to it."""

    uav: int  # row of the sensors
    target: int
    distance: float  # m, from the aim point of the camera after its earlier matches
    penalty: float  # m³; only the first match of a UAV has one


@compiled
def mark_in_view(targets: Array, seen: Flags, sensors: Array, views: Array, uav: int) -> None:
    """Mark in `seen` (T,) the targets (T, 2 or 3) m in the field of view of a UAV's sensor at (2,) m."""
    for t in range(len(targets)):
        if not seen[t]:
            seen[t] = inside(views[uav], targets[t, 0] - sensors[uav, 0], targets[t, 1] - sensors[uav, 1])


def matches(targets: Array, traces: Array, seen: Flags, sensors: Array, views: Array) -> tuple[Match, ...]:
    """Matches of UAVs and targets that are not `seen` (T,), in the order in which Algorithm 2 finds them.

    targets (T, 2 or 3) m at the end of the horizon; traces (T,) m² of their position covariances; sensors (n, 3): x, y
    [m] and D_i, overwritten with the positions p^MDO; views (n, 5, 3): fields of view of the sensors as in
    `field_of_view.view_quadrangle`. `mwtp_lanes` finds the penalties of many plans side by side.
    Source: [Li22], with β = 1.

    Note: distances are counted from the aim point of a camera; the paper's cameras look straight down.
    Note: a target that is in a field of view but hidden gets no match, because its p^MDO, the least displacement after
    which the field of view covers it, would be zero.
    """
    found = []
    for t in np.argsort(-traces, kind="stable").tolist():  # equal traces by index
        if not seen[t]:
            gaps = targets[t, :2] - sensors[:, :2]
            distances = length(gaps - views[:, 4, :2])
            uav = int(np.argmin(sensors[:, 2] + distances))
            distance = float(distances[uav])
            penalty = distance * float(traces[t]) if sensors[uav, 2] == 0.0 else 0.0
            found.append(Match(uav, t, distance, penalty))
            sensors[uav, 2] += distance
            sensors[uav, :2] += shortest_move(views, uav, *gaps[uav])
    return tuple(found)
