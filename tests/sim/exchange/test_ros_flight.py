"""Bags of ROS 2 as flights: frames of tf, detections, and what a bag must not lack."""

import math
import re
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("rosbags")
from sim.exchange.ros_bag import CAMERA, IN_IMAGE, ODOMETRY, ON_GROUND, TRANSFORMS, RosBag, Topic
from sim.exchange.scanned_flight import read_flight
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.quaternions import rotation

FOCAL = 540 / math.tan(math.radians(20))  # pixels, of 1080 over 40 degrees
TIMES = np.arange(0, 2, 0.2).tolist()
DOWN = (1.0, 0.0, 0.0, 0.0)  # attitude of the optical frame of a camera that looks straight down, north up


def stamped(time, frame):
    return divmod(round(time * 1e9), 10**9), frame


def transform(time, row, child, parent):
    return ([(stamped(time, parent), child, (row[:3], row[3:]))],)


def odometry(time, row, child, parent="map"):
    return {"header": stamped(time, parent), "child_frame_id": child, "pose": {"pose": (row[:3], row[3:])}}


def camera_info(frame, width, height, distortion=()):
    k = np.array([FOCAL, 0, (width - 1) / 2, 0, FOCAL, (height - 1) / 2, 0, 0, 1.0])
    return {"header": stamped(0.0, frame), "width": width, "height": height, "k": k, "d": np.array(distortion)}


@pytest.mark.parametrize("bend", [(), (-0.2, 0.05, 0.001, -0.002, 0.01)])
def test_a_chain_of_frames_puts_the_camera_where_tf_says(tmp_path, bend):
    turned, mounted = Rotation.from_euler("zyx", [0.7, 0.1, -0.2]), Rotation.from_euler("xyz", [0.3, -0.5, 0.2])
    optical = mounted * Rotation.from_quat(DOWN)
    with RosBag(tmp_path / "bag") as bag:
        bag.write(Topic("/drone/camera_info", CAMERA), 0.0, camera_info("drone/optical", 1920, 1080, bend))
        link = transform(0.0, [0.2, 0.0, -0.1, *optical.as_quat().tolist()], "drone/optical", "drone/base_link")
        bag.write(Topic("/tf_static", TRANSFORMS), 0.0, link)
        for time in TIMES:
            bag.write(
                Topic("/tf", TRANSFORMS), time, transform(time, [100.0, 50.0, 0.0, 0.0, 0.0, 0.0, 1.0], "odom", "map")
            )
            row = [3.0 * time, -time, 30.0, *turned.as_quat().tolist()]
            bag.write(Topic("/drone/odom", ODOMETRY), time, odometry(time, row, "drone/base_link", "odom"))
        eye = np.array([100.0, 50.0, 30.0]) + turned.apply([0.2, 0.0, -0.1])
        camera = Camera.calibrated(1920, 1080, (FOCAL, FOCAL), (960.0, 540.0), bend)
        pose = Pose(eye, (turned * mounted).as_quat())
        places = camera.ground_points(pose, np.array([[920.0, 600.0], [1800.0, 200.0]]), TARGET_HEIGHT)
        for k, time in enumerate(TIMES):
            pixels = [(920.0, 600.0), (1800.0, 200.0)] if k == 0 else []
            head = stamped(time, "drone/optical")
            boxes = [{"header": head, "bbox": ((pixel, 0.0), 9.0, 9.0)} for pixel in pixels]
            bag.write(Topic("/drone/detections", IN_IMAGE), time, (head, boxes))
    log = read_flight(tmp_path)
    np.testing.assert_allclose(rotation(log.poses[0, 0, 3:]), rotation(pose.quaternion), atol=1e-9)
    np.testing.assert_allclose(log.poses[0, 0, :3], eye, atol=1e-9)
    np.testing.assert_allclose(log.poses[5, 0, :2], eye[:2] + np.array([3, -1]), atol=1e-9)
    np.testing.assert_allclose(log.observed[0, 0].scan.measurements, places, atol=1e-6)
    assert log.frames.sum() == len(TIMES) and log.setting.uavs[0].true_camera == camera


def fly(path, *, uavs=("/uav0",), lacking="", frame="map", distortion=(), more=()):
    covariance = np.zeros((6, 6))
    covariance[:2, :2] = np.eye(2)
    with RosBag(path) as bag:
        for name in uavs if lacking != "camera" else ():
            info = camera_info(f"{name.strip('/')}/optical", 1080, 1080, distortion)
            bag.write(Topic(f"{name}/camera_info", CAMERA), 0.0, info)
        for time, name in product(TIMES, uavs):
            own = name.strip("/")
            for kind in ("odometry", *more) if lacking != "odometry" else ():
                x = 99.0 if "true" in kind else float(own.removeprefix("uav"))
                told = odometry(time, [x, 0.0, 30.0, *DOWN], f"{own}/optical")
                bag.write(Topic(f"{name}/{kind}", ODOMETRY), time, told)
            pose = ((1.0, 2.0, 0.0), DOWN)
            found = {"results": [(("person", 1.0), (pose, covariance.ravel()))], "bbox": {"center": pose}}
            bag.write(Topic(f"{name}/detections", ON_GROUND), time, (stamped(time, frame), [found]))


def test_uavs_are_in_the_order_of_their_numbers_and_true_odometry_is_left_out(tmp_path):
    fly(tmp_path / "bag", uavs=("/uav10", "/uav2"), more=("odometry_true",))
    log = read_flight(tmp_path)
    assert log.frames.all() and log.poses[:, :, 0].T.tolist() == [[2.0] * len(TIMES), [10.0] * len(TIMES)]


LACKS = {
    "odometry": ({"lacking": "odometry"}, "/uav0: has neither nav_msgs/Odometry nor tf of the frame 'uav0/optical'"),
    "camera": ({"lacking": "camera"}, "/uav0 has no topic of sensor_msgs/msg/CameraInfo; expected one, among"),
    "frame": ({"frame": "odom"}, "detections of /uav0 are in the frame 'odom', but tf ends at 'map'; expected them"),
    "distortion": ({"distortion": (-0.9, 0.0, 0.0, 0.0, 0.0)}, "/uav0: its CameraInfo: distortion: [-0.9, 0.0, 0.0, 0"),
    "file": ({"metadata": "nothing: 1\n"}, " cannot be read: "),
}


@pytest.mark.parametrize(("options", "complaint"), LACKS.values(), ids=LACKS)
def test_a_bag_that_lacks_something_is_refused_in_one_line(tmp_path, options, complaint):
    if "metadata" in options:
        (tmp_path / "metadata.yaml").write_text(options["metadata"])
    else:
        fly(tmp_path / "bag", **options)
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read_flight(tmp_path)
    assert "\n" not in str(told.value)
