"""Calibrations in the files of ROS, OpenCV, Kalibr and COLMAP, and what is refused by name."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from sim.scenario.camera_settings import CameraSettings, make_camera, read_camera
from sim.scenario.loading import load_scenario
from tracking.errors import InputError
from tracking.geometry.camera import Pose

DATA = Path(__file__).parents[2] / "data" / "calibrations"
BENT = CameraSettings(
    640, 480, focal=(512.0, 511.0), centre=(318.5, 242.5), distortion=(-0.21, 0.06, 0.0004, -0.0007, 0.0)
)
FOUR = CameraSettings(640, 480, focal=(512.0, 511.0), centre=(318.5, 242.5), distortion=(-0.21, 0.06, 0.0004, -0.0007))
FISHEYE = CameraSettings(
    1280,
    1024,
    focal=(700.5, 701.5),
    centre=(641.25, 509.75),
    distortion=(-0.012, 0.031, -0.02, 0.004),
    distortion_model="equidistant",
)
EIGHT = (0.51, -2.4, 0.0005, -0.0002, 1.4, 0.39, -2.2, 1.3)
FILES = {
    "fisheye_info.yaml": FISHEYE,
    "ros1_echo.txt": BENT,
    # of 1200 x 900 pixels from (40, 20), by twos
    "ros2_echo.txt": CameraSettings(
        600,
        450,
        focal=(490.0, 490.5),
        centre=((641 - 40 - 0.5) / 2, (477 - 20 - 0.5) / 2),
        distortion=EIGHT,
        distortion_model="rational_polynomial",
    ),
    "ost.txt": BENT,
    "out_camera_data.yml": FISHEYE,
    "out_camera_data.xml": BENT,
    "interactive.xml": BENT,
    "intrinsics.yml#1": BENT,
    "camchain.yaml#cam0": FOUR,
    "camchain.yaml#cam1": FISHEYE,
    "sensor.yaml": FOUR,
    "slam.yaml": FISHEYE,
    "vins.yaml": FOUR,
    "cameras.txt#1": FOUR,
    "cameras.txt#2": FISHEYE,
    "cameras.txt#3": CameraSettings(640, 480, focal=(512.0, 512.0), centre=(318.5, 242.5), distortion=(-0.021,)),
    "cameras.txt#4": CameraSettings(
        1280,
        960,
        focal=(980.0, 981.0),
        centre=(641.0, 477.0),
        distortion=EIGHT,
        distortion_model="rational_polynomial",
    ),
    "cameras.txt#5": CameraSettings(640, 480, focal=(512.0, 511.0), centre=(318.5, 242.5)),
    "cameras.txt#6": CameraSettings(
        1280,
        1024,
        focal=(700.0, 700.0),
        centre=(641.25, 509.75),
        distortion=(-0.012, 0.031),
        distortion_model="equidistant",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_each_program_is_the_camera_that_it_describes(name):
    assert make_camera(read_camera(str(DATA / name))) == make_camera(FILES[name])


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
@pytest.mark.parametrize("model", ["pinhole", "fisheye"])
def test_what_opencv_writes_is_the_camera_that_it_projects_with(tmp_path, suffix, model):
    path = tmp_path / f"made.{suffix}"
    matrix = np.array([[712.25, 0, 655.5], [0, 713.75, 500.125], [0, 0, 1]])
    bend = np.array([0.3, -0.1, 0.05, -0.01] if model == "fisheye" else [-0.31, 0.12, 1e-4, -2e-5, -0.015])
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in {"image_width": 1280, "image_height": 1024, "fisheye_model": int(model == "fisheye")}.items():
        storage.write(key, value)
    storage.write("camera_matrix", matrix)
    storage.write("distortion_coefficients", bend)
    storage.release()
    body = np.column_stack([np.random.default_rng(0).uniform(-0.6, 0.6, (1000, 2)), np.ones(1000)])
    none = np.zeros(3)
    project = cv2.fisheye.projectPoints if model == "fisheye" else cv2.projectPoints
    expected = project(body[:, None], none, none, matrix, bend)[0][:, 0] + 0.5
    camera = make_camera(read_camera(str(path)))
    found, _ = camera.project(Pose.level(0.0, 0.0, 0.0), body * (1, -1, -1))
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_coefficients_that_are_0_need_no_model_that_has_them(tmp_path):
    text = (DATA / "fisheye_info.yaml").read_text().replace("equidistant", "rational_polynomial")
    path = tmp_path / "info.yaml"
    path.write_text(text.replace("[-0.012, 3.1e-2, -2e-02, 0.004]", str([-0.2, 0.06, 0, 0, 0.01, *[0.0] * 9])))
    assert read_camera(str(path)).distortion == (-0.2, 0.06, 0.0, 0.0, 0.01)
    path.write_text(text.replace("[-0.012, 3.1e-2, -2e-02, 0.004]", str([-0.2, 0.06, 0, 0, 0.01, *[0.0] * 8, 0.1])))
    with pytest.raises(InputError, match=r"distortion_coefficients: .* has more than k1, k2, p1, p2, k3, k4, k5, k6$"):
        read_camera(str(path))


def test_a_scenario_names_a_camera_of_a_file_with_several(tmp_path):
    (tmp_path / "camchain.yaml").write_text((DATA / "camchain.yaml").read_text())
    (tmp_path / "own.toml").write_text('[[uavs]]\nstart = [0, 0]\nfootprint = 30\ncamera = "camchain.yaml#cam1"\n')
    path = tmp_path / "own.toml"
    named = f"uavs.0.camera={DATA / 'camchain.yaml'}#cam1"
    for uav in (load_scenario(str(path)).uavs[0], load_scenario("forest", [named]).uavs[0]):
        assert uav.true_camera == make_camera(FISHEYE)


REFUSED = {
    "camchain.yaml": "has the cameras cam0, cam1, cam2; name one, such as camchain.yaml#cam0",
    "camchain.yaml#cam3": "'cam3' is unknown; allowed are cam0, cam1, cam2",
    "camchain.yaml#cam2": "camera_matrix: its data are 5 numbers; expected 9",
    "cameras.txt": "has the cameras 1, 2, 3, 4, 5, 6, 7; name one, such as cameras.txt#1",
    "cameras.txt#7": 'distortion_model: "COLMAP\'s FOV of 5 parameters" is not allowed; expected plumb_bob, rational',
    "images.txt": "this is COLMAP's images.txt; give cameras.txt",
    "metashape.xml": "this is Metashape's calibration; export it in the format OpenCV",
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_calibration_is_refused_by_name(name):
    with pytest.raises(InputError, match=re.escape(REFUSED[name])) as error:
        read_camera(str(DATA / name))
    assert str(error.value).startswith(f"camera: {DATA / name.partition('#')[0]}") and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("file", "text", "complaint"),
    [
        (
            "points.txt",
            "# 3D point list with one line a point:\n1 0 0 0 9 9 9 0.1\n",
            "points3D.txt; give cam",
        ),
        ("images.txt", "1 0.7 0.7 0 0 1.5 -2.2 20 1 a.jpg\n\n", "this is COLMAP's images.txt; give cameras.txt"),
        ("cameras.bin", "", "is binary; give cameras.txt, as colmap model_converter --output_type TXT writes it"),
        ("imu.yaml", "rostopic: /imu0\naccelerometer_noise_density: 0.01\n", "Kalibr's file of an IMU; give the camch"),
        ("extrinsics.yml", "%YAML:1.0\n---\nR: [1, 0, 0]\n", "has no camera_matrix; expected a calibration of ROS"),
        ("some.xml", "<a><b>1</b></a>", "is XML of <a>; expected <opencv_storage>, as OpenCV writes it"),
        ("some.xml", "<a><b>1</a>", "is no XML: mismatched tag"),
        ("k.yaml", "K: [1, 0, 2, 0, 1, 2, 0, 0, 1]\n", "has no size of images; add image_width and image_height to it"),
        ("k.yaml", "K: [0, 0, 0, 0, 0, 0, 0, 0, 0]\nwidth: 640\nheight: 480\n", "is all 0, so that nobody calibrated"),
        ("k.yaml", "K: [1, 0, x, 0, 1, 2, 0, 0, 1]\n", "camera_matrix: its data are not a list of finite numbers"),
        ("f.yaml", "fx: 1\nwidth: 3\nheight: 3\n", "cx: its data are not a list of finite numbers"),
        ("none.yaml", None, "cannot be read: No such file"),
    ],
)
def test_what_is_wrong_in_a_calibration_is_one_line(tmp_path, file, text, complaint):
    path = tmp_path / file
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=re.escape(complaint)) as error:
        read_camera(str(path))
    assert str(error.value).startswith("camera: ") and "\n" not in str(error.value)
