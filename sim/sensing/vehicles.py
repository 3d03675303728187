"""UAVs as planners know them."""

import math

import numpy as np

from planning.planner import Vehicle
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.sensing.cameras import noise_of, view_of
from sim.world.quadrotor import COMMAND_LAG
from tracking.geometry.camera import Pose
from tracking.geometry.quaternions import pitch
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import arctan2, cos, sin


def vehicle_of(i: int, body: Pose, velocity: Array, scenario: Scenario) -> Vehicle:
    """UAV i as planners know it, given the pose and the velocity (2,) m/s of its body; all parts are copies."""
    uav = scenario.uavs[i]
    camera, noise = view_of(uav, scenario), noise_of(uav, scenario)
    lag = COMMAND_LAG if scenario.dynamics == "quadrotor" else 0.0
    attitude = _find_planned_attitude(uav, body)
    return Vehicle(i, body.position.copy(), camera, noise, uav.max_speed, attitude, np.array(velocity), lag)


def _find_planned_attitude(uav: Uav, body: Pose) -> Array:
    """Quaternion (4,) of the camera as planners assume it: in level flight at the present heading.

    Note: for a body-fixed camera without mounting angle the heading is ignored and taken as east, with north up.
    """
    heading = 0.0
    if uav.mount == "body" and uav.tilt_deg:
        heading = arctan2(body.rotation[1, 0], body.rotation[0, 0])
    level = np.array([0.0, 0.0, sin(heading / 2), cos(heading / 2)])
    return pitch(level, math.radians(uav.tilt_deg))
