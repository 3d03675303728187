"""Cameras of UAVs: optics, noise model and pose, and UAVs as planners know them."""

import math

import numpy as np

from planning.planner import Vehicle
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.world.quadrotor import COMMAND_LAG
from tracking.detection.noise import NoiseModel
from tracking.geometry.camera import ALL_ROUND, Camera, Pose
from tracking.geometry.quaternions import pitch
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import arctan2, cos, sin


def true_view_of(uav: Uav, scenario: Scenario) -> Camera:
    """The camera that sees: the UAV's own, or one with an unlimited field of view."""
    return Camera(ALL_ROUND, uav.pixels) if scenario.sensing.field_of_view == "unlimited" else uav.true_camera


def view_of(uav: Uav, scenario: Scenario) -> Camera:
    """The camera of a UAV's measurements, as the fleet believes it to be."""
    return Camera(ALL_ROUND, uav.pixels) if scenario.sensing.field_of_view == "unlimited" else uav.believed_camera


def noise_of(uav: Uav, scenario: Scenario) -> NoiseModel:
    """The measurement noise that the scenario gives a UAV's camera."""
    if scenario.sensing.noise == "range_bearing":
        return NoiseModel.range_bearing(uav.alpha)
    return NoiseModel.camera(uav.believed_camera, uav.altitude)


def camera_pose(uav: Uav, body: Pose) -> Pose:
    """Pose of a UAV's camera.

    A fixed camera turns with the body. A camera on a gimbal keeps the pose that it has on a level body that faces
    east. Without a mounting angle it then looks straight down with north up; the angle pitches it towards the body's
    x axis.
    """
    carrier = Pose.level(0, 0, 0).quaternion if uav.mount == "gimbal" else body.quaternion
    return Pose(body.position, pitch(carrier, math.radians(uav.tilt_deg)))


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
