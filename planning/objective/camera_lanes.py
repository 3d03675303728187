"""Paths of cameras in many plans side by side, compiled."""

from typing import NamedTuple

import numpy as np

from planning.prediction.predicted_belief import LANES, PredictedBelief
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled


class CameraLanes(NamedTuple):
    """Paths of the cameras of k UAVs in LANES plans."""

    cameras: Array  # (k, H, 2, LANES) m
    boxes: Array  # (k, H, 4) m: x0, x1, y0, y1 of the bounding box of all lanes


@compiled
def camera_lanes(belief: PredictedBelief, uavs: Indices, plans: Array) -> CameraLanes:
    """Camera paths of up to LANES plans of mean velocities (N, k, H, 2) m/s; the last fills spare lanes."""
    cameras, boxes = np.empty((len(uavs), plans.shape[2], 2, LANES)), np.empty((len(uavs), plans.shape[2], 4))
    for j in range(len(uavs)):
        for axis in range(2):
            start, now = belief.positions[uavs[j], axis], cameras[j, 0, axis]
            for lane in range(LANES):
                now[lane] = start
            for step in range(cameras.shape[1]):
                low, high = np.inf, -np.inf
                before, now = now, cameras[j, step, axis]
                for lane in range(LANES):
                    at = before[lane] + belief.step * plans[min(lane, len(plans) - 1), j, step, axis]
                    now[lane] = at
                    low, high = min(low, at), max(high, at)
                boxes[j, step, 2 * axis], boxes[j, step, 2 * axis + 1] = low, high
    return CameraLanes(cameras, boxes)
