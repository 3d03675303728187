"""Where the plan that a UAV flies leads: the home of this law, which explanations, pictures and messages share."""

from typing import NamedTuple

import numpy as np

from planning.planner import Vehicle
from planning.prediction.response import mean_velocities, response, vehicle_after
from sim.mission.snapshot import FlownPlans
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import vehicle_of
from tracking.geometry.camera import Pose
from tracking.numerics.arrays import Array

_SLACK = 1e-6  # s


class PlannedPath(NamedTuple):
    """Path of a UAV from now to the end of its plan: S + 1 corners, now and at the end of each step that is left."""

    times: Array  # (S + 1,) s
    corners: Array  # (S + 1, 2) m


def make_vehicle(scenario: Scenario, uav: int, body: Pose, here: Array, before: Array) -> Vehicle:
    """A UAV as planners know it, with its body at a pose.

    Note: the velocity is the mean on the way from its place (2,) m `before`, at the previous scan, to that `here`.
    Recordings have no other, so pictures in flight and those of the recording are the same.
    """
    return vehicle_of(uav, body, (here - before) * scenario.rates.sensing, scenario)


def predict_path(scenario: Scenario, vehicle: Vehicle, flown: FlownPlans, now: float) -> PlannedPath:
    """The path of a UAV, which is now as `vehicle` says, on the rest of the plan that it flies.

    As planners assume, its velocity follows the commands with the lag of `planning.prediction.response`.
    """
    step = scenario.rates.plan_step
    begun = scenario.plan_start(flown.made)
    over = int((now - begun + _SLACK) / step)  # steps that have been flown
    controls = np.array(flown.plans[vehicle.id].controls[over:])
    times = begun + step * np.arange(over, over + 1 + len(controls), dtype=float)
    times[0] = now
    corners = [vehicle.position[:2]]
    if len(controls):
        after = vehicle_after(vehicle, controls[0], times[1] - now)
        later = mean_velocities(response([after], step), controls[1:][None, None])[0, 0]
        corners += [after.position[:2], *(after.position[:2] + step * np.cumsum(later, axis=0))]
    return PlannedPath(times, np.array(corners))
