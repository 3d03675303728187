"""Paths of cameras in many plans side by side, compiled."""

from typing import NamedTuple

import numpy as np

from planning.prediction.predicted_belief import LANES, PredictedBelief
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled


class CameraLanes(NamedTuple):
    """Paths of the cameras of k UAVs in C groups of LANES plans."""

    cameras: Array  # (C, k, H, 2, LANES) m
    boxes: Array  # (C, k, H, 4) m: x0, x1, y0, y1 of the bounding box of a group


@compiled
def camera_lanes(belief: PredictedBelief, uavs: Indices, plans: Array) -> CameraLanes:
    """Camera paths of plans of mean velocities (N, k, H, 2) m/s; the last plan fills spare lanes."""
    groups, steps = (len(plans) + LANES - 1) // LANES, plans.shape[2]
    cameras, boxes = np.empty((groups, len(uavs), steps, 2, LANES)), np.empty((groups, len(uavs), steps, 4))
    for g in range(groups):
        for j in range(len(uavs)):
            for axis in range(2):
                start, now = belief.positions[uavs[j], axis], cameras[g, j, 0, axis]
                for lane in range(LANES):
                    now[lane] = start
                for step in range(steps):
                    low, high = np.inf, -np.inf
                    before, now = now, cameras[g, j, step, axis]
                    for lane in range(LANES):
                        at = before[lane] + belief.step * plans[min(g * LANES + lane, len(plans) - 1), j, step, axis]
                        now[lane] = at
                        low, high = min(low, at), max(high, at)
                    boxes[g, j, step, 2 * axis], boxes[g, j, step, 2 * axis + 1] = low, high
    return CameraLanes(cameras, boxes)
