"""Response of UAVs to velocity commands: their mean velocity in each step of a plan."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from planning.planner import Vehicle
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.exponential import exp
from tracking.numerics.trigonometry import hypot


class Response(NamedTuple):
    """Velocities of k UAVs, and how they follow commands over a step."""

    velocities: Array  # (k, 2) m/s, now
    lacking: Array  # (k,): share of a commanded change of velocity that the step's mean lacks
    remaining: Array  # (k,): share of the change that is still to come after the step


def response(vehicles: Sequence[Vehicle], step: float) -> Response:
    """Response of UAVs over a step [s]; the velocity of a UAV above its speed limit is reduced to the limit."""
    velocities = np.array([v.velocity for v in vehicles], dtype=float).reshape(-1, 2)
    limits = np.array([(v.max_speed, v.lag) for v in vehicles], dtype=float).reshape(-1, 2)
    return _respond(velocities, limits, float(step))


@compiled
def _respond(velocities: Array, limits: Array, step: float) -> Response:
    """`response` of UAVs with velocities (k, 2) m/s, which are reduced, and limits (k, 2): speed [m/s] and lag [s]."""
    found = Response(velocities, np.zeros(len(limits)), np.zeros(len(limits)))
    for k in range(len(limits)):
        # `Search` relies on the limit, which a quadrotor exceeds a little in gusts and turns.
        share = min(1.0, limits[k, 0] / max(hypot(velocities[k, 0], velocities[k, 1]), 1e-12))
        velocities[k, 0], velocities[k, 1] = share * velocities[k, 0], share * velocities[k, 1]
        if limits[k, 1] > 0.0:
            steps = step / limits[k, 1]
            left = exp(-steps)
            found.lacking[k], found.remaining[k] = (1.0 - left) / steps, left
    return found


def vehicle_after(vehicle: Vehicle, command: Array, step: float) -> Vehicle:
    """The UAV after a step [s] under a command (2,) m/s."""
    found, position, velocity = response([vehicle], step), vehicle.position.copy(), np.empty(2)
    for axis in range(2):
        mean, velocity[axis] = follow_command(found, 0, found.velocities[0, axis], command[axis])
        position[axis] += step * mean
    return replace(vehicle, position=position, velocity=velocity)


@compiled
def mean_velocities(response: Response, plans: Array) -> Array:
    """Mean velocities (N, k, H, 2) m/s in the steps of plans (N, k, H, 2) m/s.

    The velocity v follows a command u with a first-order lag, dv/dt = (u - v) / lag. The mean velocities take the place
    of the controls in [Li22] eq. (5); without a lag both are equal.
    """
    means = np.empty_like(plans)
    for n in range(len(plans)):
        for j in range(plans.shape[1]):
            for axis in range(2):
                v = response.velocities[j, axis]
                for h in range(plans.shape[2]):
                    means[n, j, h, axis], v = follow_command(response, j, v, plans[n, j, h, axis])
    return means


@inlined
def follow_command(response: Response, j: int, v: float, u: float) -> tuple[float, float]:
    """Mean and final velocity of UAV j in a step under command u from velocity v, along one axis [m/s]."""
    return u + response.lacking[j] * (v - u), u + response.remaining[j] * (v - u)


def camera_paths(positions: Array, velocities: Array, step: float) -> Array:
    """Positions (..., n, H, 3) m of cameras at mean velocities (..., n, H, 2) m/s from (n, 3) m ([Li22] eq. (5))."""
    path = np.empty((*velocities.shape[:-1], 3))
    path[..., :2] = positions[:, None, :2] + step * np.cumsum(velocities, axis=-2)
    path[..., 2] = positions[:, None, 2]
    return path
