"""The policy of intent and the base policy that extends it ([Li22] III-B)."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from planning.planner import Situation, Vehicle
from planning.prediction.field_of_view import aim_point
from planning.prediction.propagation import nominal_positions
from planning.prediction.response import Response, follow_command, response
from tracking.numerics.arrays import Array, Indices
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
    return np.asarray(_extend_intents(situation, [vehicle], horizon)[0])


def expect_plans(situation: Situation, horizon: int, decided: Mapping[int, Array] = MappingProxyType({})) -> Array:
    """Plans (n, H, 2) m/s of all UAVs: those `decided`, by id, and the policy of intent of each other UAV."""
    vehicles = situation.vehicles
    expected = [v for v in vehicles if v.id not in decided]
    plans = dict(decided)
    plans.update(zip((v.id for v in expected), _extend_intents(situation, expected, horizon), strict=True))
    return np.array([plans[v.id] for v in vehicles])


def _extend_intents(situation: Situation, vehicles: Sequence[Vehicle], horizon: int) -> Array:
    plans, given = np.zeros((len(vehicles), horizon, 2)), np.zeros(len(vehicles), np.int64)
    for k, vehicle in enumerate(vehicles):
        if plan := situation.intents.get(vehicle.id):
            known = plan.controls[1 : horizon + 1]
            given[k] = len(known)
            plans[k, : len(known)] = known
    _extend(plans, given, _make_pursuit(situation, vehicles, horizon), float(situation.step))
    return plans


def base_policy_plans(situation: Situation, vehicle: Vehicle, given: Array, horizon: int) -> Array:
    """Plans (N, H, 2) m/s that begin with the controls `given` (N, h, 2) and continue with the base policy.

    The policy starts from the position that the UAV reaches with its lag, but chooses controls as if it had no lag.
    """
    plans = np.zeros((len(given), horizon, 2))
    plans[:, : given.shape[1]] = given
    steps = np.full(len(given), given.shape[1])
    _extend(plans, steps, _make_pursuit(situation, [vehicle], horizon), float(situation.step))
    return plans


class _Pursuit(NamedTuple):
    """UAVs and the targets that they may pursue."""

    positions: Array  # (k, 2) m
    aims: Array  # (k, 2) m from the UAV: the point that the middle of its image shows
    response: Response
    max_speeds: Array  # (k,) m/s
    places: Array  # (H, T, 2) m: of targets after each step
    traces: Array  # (T,) m²


def _make_pursuit(situation: Situation, vehicles: Sequence[Vehicle], horizon: int) -> _Pursuit:
    _, covariances = beliefs_of(situation.tracks)
    return _Pursuit(
        np.array([v.position[:2] for v in vehicles], dtype=float).reshape(-1, 2),
        np.array([aim_point(v) for v in vehicles], dtype=float).reshape(-1, 2),
        response(vehicles, situation.step),
        np.array([v.max_speed for v in vehicles], dtype=float),
        nominal_positions(situation, horizon),
        covariances[:, 0, 0] + covariances[:, 1, 1],
    )


@compiled
def _extend(plans: Array, given: Indices, pursuit: _Pursuit, step: float) -> None:
    """Extend the `given` (N,) first controls of plans (N, H, 2) m/s by `base_control`; a step takes `step` s.

    There is a UAV for each plan, or one for all.
    """
    follows = pursuit.response
    for n in range(len(plans)):
        k = min(n, len(pursuit.positions) - 1)
        vx, vy = follows.velocities[k]
        way_x = way_y = 0.0
        for h in range(given[n]):
            mean_x, vx = follow_command(follows, k, vx, plans[n, h, 0])
            mean_y, vy = follow_command(follows, k, vy, plans[n, h, 1])
            way_x, way_y = way_x + mean_x, way_y + mean_y
        x = pursuit.positions[k, 0] + step * way_x + pursuit.aims[k, 0]
        y = pursuit.positions[k, 1] + step * way_y + pursuit.aims[k, 1]
        for h in range(given[n], plans.shape[1]):
            plans[n, h, 0], plans[n, h, 1] = _chase(
                x, y, pursuit.places[h], pursuit.traces, step, pursuit.max_speeds[k]
            )
            mean_x, vx = follow_command(follows, k, vx, plans[n, h, 0])
            mean_y, vy = follow_command(follows, k, vy, plans[n, h, 1])
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
