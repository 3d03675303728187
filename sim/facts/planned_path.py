"""Where the plan that a UAV flies leads: the home of this law, which explanations, pictures and messages share."""

import numpy as np

from planning.planner import Vehicle
from planning.prediction.response import mean_velocities, response
from sim.mission.knowledge import BodyState, vehicle_of
from sim.mission.snapshot import FlownPlans
from sim.scenario.scenario import Scenario
from tracking.geometry.camera import Pose
from tracking.numerics.arrays import Array


def make_vehicle(scenario: Scenario, uav: int, body: Pose, here: Array, before: Array) -> Vehicle:
    """A UAV as planners know it, with its body at a pose.

    Note: the velocity is the mean on the way from its place (2,) m `before`, at the previous scan, to that `here`.
    Recordings have no other, so pictures in flight and those of the recording are the same.
    """
    return vehicle_of(scenario, uav, BodyState(body, (here - before) * scenario.rates.sensing))


def predict_path(scenario: Scenario, vehicle: Vehicle, flown: FlownPlans, now: float) -> Array:
    """Places (S + 1, 2) m of a UAV, which is now as `vehicle` says, at each scan from now to the end of its plan.

    As planners assume, its velocity follows the commands with the lag of `planning.prediction.response`. Steps of one
    scan add up to those of planners, because the lag is exponential.
    """
    rates, step = scenario.rates, 1 / scenario.rates.sensing
    over = round((now - scenario.plan_start(flown.made)) / step)  # scans for which the plan has been flown
    controls = np.repeat(flown.plans[vehicle.id].controls, rates.plan_scans, axis=0)[over:]
    flights = mean_velocities(response([vehicle], step), controls[None, None])[0, 0]
    return np.asarray(vehicle.position[:2] + np.vstack([np.zeros(2), step * np.cumsum(flights, axis=0)]))
