"""Response of UAVs to velocity commands: their mean velocity in each step of a plan."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planning.planner import Plan, Situation, Vehicle
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.exponential import exp
from tracking.numerics.trigonometry import hypot


class Response(NamedTuple):
    """Velocities of k UAVs, and how they follow commands over a step."""

    velocities: Array  # (k, 2) m/s, now
    lacks: Array  # (k,): share of a commanded change of velocity that the step's mean lacks
    lefts: Array  # (k,): share of it that is left to come after the step

    @classmethod
    def at_once(cls, count: int) -> "Response":
        """Response of so many hovering UAVs that take a command at once, [Li22] eq. (5)."""
        return cls(np.zeros((count, 2)), np.zeros(count), np.zeros(count))


def response(situation: Situation, uavs: Sequence[int]) -> Response:
    """Response of the UAVs in rows `uavs`, each taken to fly at its last known command, or to hover without one.

    Note: a last command is nearly reached after a step of 1.5 lags or more. At five decisions a second it is not, and
    little of what the lag explains is foreseen.
    """
    vehicles = [situation.vehicles[i] for i in uavs]
    hover = Plan(np.zeros((0, 2)))
    plans = [situation.intents.get(v.id, hover).controls for v in vehicles]
    return response_from(vehicles, [plan[0] if len(plan) else np.zeros(2) for plan in plans], situation.step)


def response_from(vehicles: Sequence[Vehicle], commands: Sequence[Array], step: float) -> Response:
    """Response over steps [s] of UAVs that fly at these commands (2,) m/s, or as fast as they can."""
    found = Response.at_once(len(vehicles))  # none faster than its limit: `Search` relies on how far UAVs get
    for k, (vehicle, command) in enumerate(zip(vehicles, commands, strict=True)):
        found.velocities[k] = command * min(1.0, vehicle.max_speed / max(hypot(command[0], command[1]), 1e-12))
        if vehicle.lag > 0.0:
            steps = step / vehicle.lag
            left = exp(-steps)
            found.lacks[k], found.lefts[k] = (1.0 - left) / steps, left
    return found


@compiled
def mean_velocities(response: Response, plans: Array) -> Array:
    """Mean velocities (N, k, H, 2) m/s in the steps of plans (N, k, H, 2) m/s.

    The velocity v follows a command u as a first-order lag, dv/dt = (u - v) / lag. The means take the place of the
    controls in [Li22] eq. (5), and are equal to them without a lag.
    """
    means = np.empty_like(plans)
    for n in range(len(plans)):
        for j in range(plans.shape[1]):
            for axis in range(2):
                v = response.velocities[j, axis]
                for h in range(plans.shape[2]):
                    means[n, j, h, axis], v = followed(response, j, v, plans[n, j, h, axis])
    return means


@inlined
def followed(response: Response, j: int, v: float, u: float) -> tuple[float, float]:
    """Mean and last velocity of a step that UAV j begins at velocity v, under the command u, along one axis [m/s]."""
    return u + response.lacks[j] * (v - u), u + response.lefts[j] * (v - u)
