"""Cameras of UAVs: optics, noise model and pose."""

import math

from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from tracking.detection.noise import NoiseModel
from tracking.geometry.camera import ALL_ROUND, Camera, Pose
from tracking.geometry.quaternions import pitch


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
