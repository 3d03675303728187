"""The policy of intent and the base policy that extends it ([Li22] III-B)."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from planning.planner import Plan, Situation, Vehicle
from planning.prediction.field_of_view import aim_point
from planning.prediction.propagation import nominal_positions
from planning.prediction.response import Response, follow_command, response
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined
from tracking.track import beliefs_of

BASE_RANGE = 40.0  # m: largest distance of tracks that the base policy considers


def base_control(situation: Situation) -> Array:
    """Base policy: fly at full speed towards the track of largest covariance trace within 40 m; (2,) m/s.

    Tracks have their nominal positions one step later, when the UAV can be there, and their present covariances. The
    UAV steers the middle of its image towards the track, and without a lag does not overshoot. It hovers if no track is
    near.
    """
    return np.asarray(base_policy_plans(situation, situation.own, np.empty((1, 0, 2)), 1)[0, 0])


def policy_of_intent(situation: Situation, vehicle: Vehicle, horizon: int) -> Array:
    """Controls (H, 2) m/s that a UAV is expected to fly: its last plan shifted, extended by the base policy."""
    known = situation.intents.get(vehicle.id, Plan(np.zeros((0, 2)))).controls[1 : horizon + 1]
    return np.asarray(base_policy_plans(situation, vehicle, known[None], horizon)[0])


def expect_plans(situation: Situation, horizon: int, decided: Mapping[int, Array] = MappingProxyType({})) -> Array:
    """Plans (n, H, 2) m/s of all UAVs: those `decided`, by id, and the policy of intent of each other UAV."""
    plans = [decided[v.id] if v.id in decided else policy_of_intent(situation, v, horizon) for v in situation.vehicles]
    return np.array(plans)


def base_policy_plans(situation: Situation, vehicle: Vehicle, given: Array, horizon: int) -> Array:
    """Plans (N, H, 2) m/s that begin with the controls `given` (N, h, 2) and continue with the base policy.

    The policy starts from the position that the UAV reaches with its lag, but chooses controls as if it had no lag.
    """
    given_steps, (_, covariances) = given.shape[1], beliefs_of(situation.tracks)
    traces, places = covariances[:, 0, 0] + covariances[:, 1, 1], nominal_positions(situation, horizon)
    plans = np.zeros((len(given), horizon, 2))
    plans[:, :given_steps] = given
    pursuit = _Pursuit(
        vehicle.position[:2].astype(float),
        aim_point(vehicle).astype(float),
        response([vehicle], situation.step),
        float(vehicle.max_speed),
        places,
        traces,
    )
    _extend(plans, given_steps, pursuit, float(situation.step))
    return plans


class _Pursuit(NamedTuple):
    """A UAV and the targets that it may pursue."""

    position: Array  # (2,) m
    aim: Array  # (2,) m from the UAV: the point that the middle of its image shows
    response: Response
    max_speed: float  # m/s
    places: Array  # (H, T, 2) m: of targets after each step
    traces: Array  # (T,) m²


@compiled
def _extend(plans: Array, given_steps: int, pursuit: _Pursuit, step: float) -> None:
    """Extend the first `given_steps` controls of plans (N, H, 2) m/s by `base_control`; a step takes `step` s."""
    position, aim, follows = pursuit.position, pursuit.aim, pursuit.response
    for n in range(len(plans)):
        vx, vy = follows.velocities[0]
        way_x = way_y = 0.0
        for h in range(given_steps):
            mean_x, vx = follow_command(follows, 0, vx, plans[n, h, 0])
            mean_y, vy = follow_command(follows, 0, vy, plans[n, h, 1])
            way_x, way_y = way_x + mean_x, way_y + mean_y
        x, y = position[0] + step * way_x + aim[0], position[1] + step * way_y + aim[1]
        for h in range(given_steps, plans.shape[1]):
            plans[n, h, 0], plans[n, h, 1] = _chase(x, y, pursuit.places[h], pursuit.traces, step, pursuit.max_speed)
            mean_x, vx = follow_command(follows, 0, vx, plans[n, h, 0])
            mean_y, vy = follow_command(follows, 0, vy, plans[n, h, 1])
            x, y = x + step * mean_x, y + step * mean_y


@inlined
def _chase(x: float, y: float, places: Array, traces: Array, step: float, max_speed: float) -> tuple[float, float]:
    """`base_control` [m/s] of a UAV with its aim point at (x, y) m, for places (T, 2) m with traces (T,) m²."""
    most = east = north = 0.0
    for t in range(len(places)):
        dx, dy = places[t, 0] - x, places[t, 1] - y
        distance = math.sqrt(dx * dx + dy * dy)
        if distance <= BASE_RANGE and traces[t] > most:
            most, slower = traces[t], min(1.0, max_speed * step / max(distance, 1e-300))
            east, north = dx / step * slower, dy / step * slower
    return east, north
