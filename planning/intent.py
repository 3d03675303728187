"""The policy of intent and the base policy that extends it ([Li22] III-C)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planning.planner import Plan, Situation, Vehicle
from planning.propagation import beliefs
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
    return _towards(vehicle, position + aim(vehicle), beliefs(tracks), ahead, step)


def policy_of_intent(situation: Situation, vehicle: Vehicle, horizon: int) -> Array:
    """Controls (H, 2) m/s that a UAV is expected to fly: its last plan shifted, extended by the base policy."""
    known = situation.intents.get(vehicle.id, Plan(np.zeros((0, 2))))
    controls = list(known.controls[1 : horizon + 1])
    if len(controls) == horizon:
        return np.array(controls)
    step, tracks = situation.step, beliefs(situation.tracks)
    aimed = vehicle.position[:2] + step * np.sum(controls, axis=0) + aim(vehicle)
    while len(controls) < horizon:
        control = _towards(vehicle, aimed, tracks, len(controls) * step, step)
        controls.append(control)
        aimed = aimed + step * control
    return np.array(controls)


def _towards(vehicle: Vehicle, aimed: Array, tracks: tuple[Array, Array], ahead: float, step: float) -> Array:
    """`base_control` of a vehicle that is `aimed` at (2,) m, among tracks of means (T, 4), covariances (T, 4, 4)."""
    means, covariances = tracks
    gaps = means[:, :2] + (ahead + step) * means[:, 2:] - aimed
    traces = np.where(np.hypot(gaps[:, 0], gaps[:, 1]) <= BASE_RANGE, covariances[:, 0, 0] + covariances[:, 1, 1], 0.0)
    if not traces.any():
        return np.zeros(2)
    control = gaps[np.argmax(traces)] / step
    speed = np.hypot(*gaps[np.argmax(traces)]) / step
    return np.asarray(control if speed <= vehicle.max_speed else control * (vehicle.max_speed / speed))


def paths(positions: Array, controls: Array, step: float) -> Array:
    """Where cameras (..., n, H, 3) m get by controls (..., n, H, 2) m/s from positions (n, 3) m ([Li22] eq. (5))."""
    path = np.empty((*controls.shape[:-1], 3))
    path[..., :2] = positions[:, None, :2] + step * np.cumsum(controls, axis=-2)
    path[..., 2] = positions[:, None, 2]
    return path
