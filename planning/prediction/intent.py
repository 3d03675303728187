"""The policy of intent and the base policy that extends it ([Li22] III-C)."""

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from planning.planner import Plan, Situation, Vehicle
from planning.prediction.field_of_view import aim_point
from planning.prediction.propagation import nominal_positions
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.track import beliefs_of

BASE_RANGE = 40.0  # m: the base policy looks no further


def base_control(situation: Situation) -> Array:
    """Base policy: fly at full speed towards the track of largest covariance trace within 40 m; (2,) m/s.

    The tracks are taken at their nominal positions one step later, when the UAV can be there, with the covariances they
    have now. The middle of the image is steered towards the track. It arrives without overshooting, and hovers if no
    track is near.
    """
    return np.asarray(base_policy_plans(situation, situation.own, np.empty((1, 0, 2)), 1)[0, 0])


def policy_of_intent(situation: Situation, vehicle: Vehicle, horizon: int) -> Array:
    """Controls (H, 2) m/s that a UAV is expected to fly: its last plan shifted, extended by the base policy."""
    known = situation.intents.get(vehicle.id, Plan(np.zeros((0, 2)))).controls[1 : horizon + 1]
    return np.asarray(base_policy_plans(situation, vehicle, known[None], horizon)[0])


def expected_plans(situation: Situation, horizon: int, decided: Mapping[int, Array] = MappingProxyType({})) -> Array:
    """Plans (n, H, 2) m/s of all UAVs: decided ones, by id, else their policies of intent."""
    plans = [decided[v.id] if v.id in decided else policy_of_intent(situation, v, horizon) for v in situation.vehicles]
    return np.array(plans)


def base_policy_plans(situation: Situation, vehicle: Vehicle, firsts: Array, horizon: int) -> Array:
    """Plans (N, H, 2) m/s that begin with the controls `firsts` (N, h, 2) and go on by the base policy."""
    step, begun = situation.step, firsts.shape[1]
    _, covariances = beliefs_of(situation.tracks)
    traces, places = covariances[:, 0, 0] + covariances[:, 1, 1], nominal_positions(situation, horizon)
    plans = np.empty((len(firsts), horizon, 2))
    plans[:, :begun] = firsts
    aimed = vehicle.position[:2] + step * firsts.sum(axis=1) + aim_point(vehicle)
    for k in range(begun, horizon):
        plans[:, k] = _towards(aimed, places[k], traces, step, vehicle.max_speed)
        aimed = aimed + step * plans[:, k]
    return plans


@compiled
def _towards(aimed: Array, places: Array, traces: Array, step: float, max_speed: float) -> Array:
    """`base_control` (N, 2) m/s of a vehicle that is aimed at (N, 2) m, to places (T, 2) m with traces (T,) m²."""
    controls = np.zeros_like(aimed)
    for n in range(len(aimed)):
        most = 0.0
        for t in range(len(places)):
            x, y = places[t, 0] - aimed[n, 0], places[t, 1] - aimed[n, 1]
            distance = math.sqrt(x * x + y * y)
            if distance <= BASE_RANGE and traces[t] > most:
                most, slower = traces[t], min(1.0, max_speed * step / max(distance, 1e-300))
                controls[n, 0], controls[n, 1] = x / step * slower, y / step * slower
    return controls


def camera_paths(positions: Array, velocities: Array, step: float) -> Array:
    """Positions (..., n, H, 3) m of cameras at mean velocities (..., n, H, 2) m/s from (n, 3) m ([Li22] eq. (5))."""
    path = np.empty((*velocities.shape[:-1], 3))
    path[..., :2] = positions[:, None, :2] + step * np.cumsum(velocities, axis=-2)
    path[..., 2] = positions[:, None, 2]
    return path
