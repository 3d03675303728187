"""Learned cost-to-go: errors of targets in the seconds after the horizon, compiled."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planning.planner import Vehicle
from planning.prediction.field_of_view import view_quadrangle
from planning.prediction.predicted_belief import LANES, PredictedBelief
from planning.prediction.quadrangle import radius_in_view
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import inlined

# Mean squared error of a track over the next 15 s in units of c², the square of the cut-off, summed over the seconds.
# Rows: standard deviations of 0, 0.2, ..., 1 times c now; columns: 0, 2, ..., 10 s until the nearest UAV can have the
# target in view. Fitted to missions in tests/planning/objective/test_future_errors.py.
FUTURE = np.array(
    [
        [0.54, 0.95, 0.95, 0.95, 1.78, 1.78],
        [0.83, 1.24, 2.68, 6.03, 6.86, 6.86],
        [0.83, 1.24, 2.68, 6.61, 7.44, 7.44],
        [1.55, 1.95, 3.40, 7.32, 8.15, 8.93],
        [1.55, 1.95, 3.95, 7.87, 11.20, 11.99],
        [4.23, 4.63, 7.94, 12.71, 15.00, 15.00],
    ]
)
DEVIATION, SECONDS = 0.2, 2.0  # between the rows, in units of c, and between the columns
LATEST = SECONDS * (FUTURE.shape[1] - 1)  # s until a target can be in view, from which on its errors are the same


class CostToGo(NamedTuple):
    """Weight of the cost-to-go, and how soon each of n UAVs can have a place in view."""

    weight: float  # 0: no cost-to-go
    radii: Array  # (n,) m: of the largest circle in view about a UAV's aim point
    speeds: Array  # (n,) m/s


NO_COST_TO_GO = CostToGo(0.0, np.empty(0), np.empty(0))


def cost_to_go(vehicles: Sequence[Vehicle], weight: float) -> CostToGo:
    """Cost-to-go of the targets of these UAVs; with weight one it is the errors in the 15 s after a plan."""
    if weight == 0.0:
        return NO_COST_TO_GO
    radii = radius_in_view(np.array([view_quadrangle(v) for v in vehicles]))
    return CostToGo(weight, radii, np.array([v.max_speed for v in vehicles]))


@inlined
def lower_times_to_view(
    seconds: Array, belief: PredictedBelief, ahead: CostToGo, target: int, uav: int, cameras: Array
) -> None:
    """Lower the times until a target can be in view, where this UAV needs less time after its plan.

    It flies straight at full speed, until the target is in the largest circle about its aim point; the time is negative
    if it is there.
    `target` and `uav` are rows of the belief, and `ahead` has the UAVs' radii and speeds. seconds (LANES,) s are
    changed in place; cameras (2, LANES) m: positions of the UAV at the end of the horizon.
    """
    place, aim, radius, speed = belief.points[-1, target, 0], belief.views[uav, 4], ahead.radii[uav], ahead.speeds[uav]
    x, y = place[0] - aim[0], place[1] - aim[1]
    for lane in range(LANES):
        dx, dy = x - cameras[0, lane], y - cameras[1, lane]
        needed = (math.sqrt(dx * dx + dy * dy) - radius) / speed
        seconds[lane] = needed if needed < seconds[lane] else seconds[lane]


@inlined
def replace_by_future_errors(seconds: Array, traces: Array, cutoff: float) -> None:
    """Replace `seconds` (LANES,) until a target can be in view by its errors [m² s], from its `traces` (LANES,) [m²].

    `FUTURE` is interpolated linearly, and constant beyond its ends.
    """
    rows, columns = FUTURE.shape
    for lane in range(LANES):
        y, x = math.sqrt(traces[lane]) / (DEVIATION * cutoff), seconds[lane] / SECONDS
        y = y if y < rows - 1.0 else rows - 1.0
        x = (x if x > 0.0 else 0.0) if x < columns - 1.0 else columns - 1.0
        i, j = min(int(y), rows - 2), min(int(x), columns - 2)
        y, x = y - i, x - j
        near = FUTURE[i, j] + x * (FUTURE[i, j + 1] - FUTURE[i, j])
        far = FUTURE[i + 1, j] + x * (FUTURE[i + 1, j + 1] - FUTURE[i + 1, j])
        seconds[lane] = cutoff * cutoff * (near + y * (far - near))
