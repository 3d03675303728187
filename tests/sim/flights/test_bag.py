"""Bags of ROS 2 as flights: frames of tf, detections, and what a bag must not lack."""

import math
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("rosbags")
from helpers.bags import OPTICAL, Bag

from sim.flights.flight_log import read_flight
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose, rotation
from tracking.geometry.visibility import TARGET_HEIGHT

FOCAL = 540 / math.tan(math.radians(20))  # pixels, of 1080 over 40 degrees
TIMES = np.arange(0, 2, 0.2).tolist()


def test_a_chain_of_frames_puts_the_camera_where_tf_says(tmp_path):
    turned, mounted = Rotation.from_euler("zyx", [0.7, 0.1, -0.2]), Rotation.from_euler("xyz", [0.3, -0.5, 0.2])
    optical = mounted * Rotation.from_quat(OPTICAL[3:])
    with Bag(tmp_path / "bag") as bag:
        bag.write_camera("/drone/camera_info", "drone/optical", FOCAL, 1920, 1080)
        for time in TIMES:
            bag.write_transform("/tf", time, [100.0, 50.0, 0.0, 0.0, 0.0, 0.0, 1.0], "odom", "map")
            row = [3.0 * time, -time, 30.0, *turned.as_quat().tolist()]
            bag.write_odometry("/drone/odom", time, row, "drone/base_link", "odom")
        bag.write_transform(
            "/tf_static", 0.0, [0.2, 0.0, -0.1, *optical.as_quat().tolist()], "drone/optical", "drone/base_link"
        )
        eye = np.array([100.0, 50.0, 30.0]) + turned.apply([0.2, 0.0, -0.1])
        camera = Camera(math.radians(40), 1080)
        pose = Pose(eye, (turned * mounted).as_quat())
        places = camera.ground_points(pose, np.array([[500.0, 600.0], [300.0, 200.0]]), TARGET_HEIGHT)
        for k, time in enumerate(TIMES):
            bag.write_pixels(
                "/drone/detections", time, np.array([[920.0, 600.0], [720.0, 200.0]])[: 2 * (k == 0)], "drone/optical"
            )
    log = read_flight(tmp_path)
    np.testing.assert_allclose(rotation(log.poses[0, 0, 3:]), rotation(pose.quaternion), atol=1e-9)
    np.testing.assert_allclose(log.poses[0, 0, :3], eye, atol=1e-9)
    np.testing.assert_allclose(log.poses[5, 0, :2], eye[:2] + np.array([3, -1]), atol=1e-9)
    np.testing.assert_allclose(log.observed[0, 0][0].measurements, places, atol=1e-6)
    assert log.frames.sum() == len(TIMES) and log.setting.uavs[0].fov_deg == pytest.approx(40)


def fly(path, *, uavs=("/uav0",), lacking="", frame="map", distortion=(), more=()):
    with Bag(path) as bag:
        for name in uavs:
            own = name.strip("/")
            if lacking != "camera":
                bag.write_camera(f"{name}/camera_info", f"{own}/optical", FOCAL, 1080, 1080, distortion)
            for time in TIMES:
                for kind in ("odometry", *more):
                    x = 99.0 if "true" in kind else float(own.removeprefix("uav"))
                    if lacking != "odometry":
                        bag.write_odometry(f"{name}/{kind}", time, [x, 0.0, 30.0, *OPTICAL[3:]], f"{own}/optical")
                if lacking != "detections":
                    bag.write_places(f"{name}/detections", time, np.array([[1.0, 2.0]]), np.array([np.eye(2)]), frame)


def test_uavs_are_in_the_order_of_their_numbers_and_true_odometry_is_left_out(tmp_path):
    fly(tmp_path / "bag", uavs=("/uav10", "/uav2"), more=("odometry_true",))
    log = read_flight(tmp_path)
    assert log.frames.all() and log.poses[:, :, 0].T.tolist() == [[2.0] * len(TIMES), [10.0] * len(TIMES)]


LACKS = {
    "odometry": ({"lacking": "odometry"}, "/uav0: has neither nav_msgs/Odometry nor tf of the frame 'uav0/optical'"),
    "camera": ({"lacking": "camera"}, "/uav0 has no topic of sensor_msgs/msg/CameraInfo; expected one, among"),
    "detections": ({"lacking": "detections"}, "/uav0 has no topic of vision_msgs/msg/Detection2DArray; expected"),
    "frame": ({"frame": "odom"}, "detections of /uav0 are in the frame 'odom', but tf ends at 'map'; expected them"),
    "distortion": ({"distortion": (0.1, 0.0, 0.0, 0.0, 0.0)}, "/uav0: its CameraInfo has a distortion; rectify"),
}


@pytest.mark.parametrize(("options", "complaint"), LACKS.values(), ids=LACKS)
def test_a_bag_that_lacks_something_is_refused_in_one_line(tmp_path, options, complaint):
    fly(tmp_path / "bag", **options)
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read_flight(tmp_path)
    assert "\n" not in str(told.value)


def test_a_bag_that_cannot_be_read_is_refused_in_one_line(tmp_path):
    (tmp_path / "metadata.yaml").write_text("nothing: 1\n")
    with pytest.raises(InputError, match=r"^bag: .* cannot be read: ") as told:
        read_flight(tmp_path)
    assert "\n" not in str(told.value)
