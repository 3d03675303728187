"""The policy of intent and the base policy that extends it ([Li22] III-C)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planning.planner import Plan, Situation, Vehicle
from planning.view import aim
from tracking.compiled import Array
from tracking.tracker import Track

BASE_RANGE = 40.0  # m: the base policy looks no further


def base_control(vehicle: Vehicle, position: Array, tracks: Sequence[Track], ahead: float, step: float) -> Array:
    """Base policy: fly at full speed towards the track of largest covariance trace within 40 m; (2,) m/s.

    position (2,) m is the vehicle's after `ahead` s; the tracks are taken at their nominal positions one step later,
    when it can be there, with the covariances they have now. What flies towards a track is the middle of the image.
    Arrives rather than overshoots; hovers where no track is near.
    """
    best, direction, aimed = 0.0, np.zeros(2), position + aim(vehicle)
    for track in tracks:
        gap = track.belief.mean[:2] + (ahead + step) * track.belief.mean[2:] - aimed
        trace = track.belief.covariance[0, 0] + track.belief.covariance[1, 1]
        if trace > best and np.hypot(*gap) <= BASE_RANGE:
            best, direction = trace, gap
    speed = np.hypot(*direction) / step
    return direction / step if speed <= vehicle.max_speed else direction / step * (vehicle.max_speed / speed)


def policy_of_intent(situation: Situation, vehicle: Vehicle, horizon: int) -> Array:
    """Controls (H, 2) m/s that a UAV is expected to fly: its last plan shifted, extended by the base policy."""
    known = situation.intents.get(vehicle.id, Plan(np.zeros((0, 2))))
    controls = list(known.controls[1 : horizon + 1])
    step = situation.step
    position = vehicle.position[:2] + step * np.sum(controls, axis=0) if controls else vehicle.position[:2]
    while len(controls) < horizon:
        control = base_control(vehicle, position, situation.tracks, len(controls) * step, step)
        controls.append(control)
        position = position + step * control
    return np.array(controls)


def paths(positions: Array, controls: Array, step: float) -> Array:
    """Where cameras (..., n, H, 3) m get by controls (..., n, H, 2) m/s from positions (n, 3) m ([Li22] eq. (5))."""
    path = np.empty((*controls.shape[:-1], 3))
    path[..., :2] = positions[:, None, :2] + step * np.cumsum(controls, axis=-2)
    path[..., 2] = positions[:, None, 2]
    return path
