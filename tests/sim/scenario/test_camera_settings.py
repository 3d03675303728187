"""Cameras of scenarios: files, views on the ground, beliefs, and what is wrong with them."""

import cv2
import msgspec
import numpy as np
import pytest

from sim.scenario.camera_settings import CAMERAS, CameraSettings, make_camera, read_camera
from sim.scenario.loading import decode_recorded, load_scenario, resolve_scenario
from sim.scenario.scenario import Scenario, encode_scenario
from sim.scenario.settings_text import format_overrides
from sim.scenario.uavs import UavSettings
from tracking.errors import InputError
from tracking.geometry.camera import Pose

CAMERA_INFO = """
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [438.783367, 0.0, 305.593336, 0.0, 437.302876, 243.738352, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361976, 0.110510, 0.001014, 0.000505,
         0.0]
"""


def scenario_file(folder, camera: str, more: str = ""):
    path = folder / "scenario.toml"
    path.write_text(f"[[uavs]]\nstart = [0, 0]\nfootprint = 30\ncamera = {camera}\n{more}")
    return path


def test_an_override_by_a_camera_alone_takes_its_angle_of_view():
    uav = load_scenario("forest", ['uavs.1.camera="thermal-640"']).uavs[1]
    assert uav.pixels == uav.true_camera.size[0] == 640 and uav.footprint == load_scenario("forest").uavs[1].footprint
    with pytest.raises(InputError, match="fov_deg 60 is not that of the camera"):
        load_scenario("forest", ["uavs.1.fov_deg=60", 'uavs.1.camera="thermal-640"'])


def test_of_a_camera_given_by_name_one_key_may_be_changed(tmp_path, monkeypatch):
    (tmp_path / "own.toml").write_text("width = 320\nheight = 200\nhfov_deg = 60\ndistortion = [-0.1]\n")
    path = scenario_file(tmp_path, '"own.toml"')
    monkeypatch.chdir("/")  # an own file is found beside the scenario as before
    assert load_scenario(str(path), ["uavs.0.camera.scale=0.5"]).uavs[0].true_camera.size == (160, 100)
    named, small = load_scenario("forest", ["uavs.0.camera=mavic-3e"]), {"uavs.0.camera.scale": 0.05}
    for scenario in (
        load_scenario("forest", ["uavs.0.camera=mavic-3e", *format_overrides(small)]),
        resolve_scenario(named, small),
    ):
        expected = msgspec.structs.replace(read_camera("mavic-3e"), scale=0.05)
        assert scenario.uavs[0].camera == expected and scenario.uavs[0].pixels == 264
    wrong = load_scenario(str(path), ["uavs.0.camera.believed.distortion=[]"]).uavs[0]
    assert wrong.true_camera.is_bent and not wrong.believed_camera.is_bent
    for override, message in (
        ("uavs.0.camera.scal=0.5", r"uavs.0.camera.scal: unknown key; allowed are .*did you mean scale\?"),
        ("uavs.0.camera.focal=[50, 50]", "uavs.0.camera: hfov_deg and focal: one of them is needed"),
    ):
        with pytest.raises(InputError, match=message):
            load_scenario(str(path), [override])
    with pytest.raises(InputError, match=r"camera: 'mavik-3e' is unknown; allowed are .*; did you mean mavic-3e"):
        load_scenario("forest", ["uavs.0.camera=mavik-3e", "uavs.0.camera.scale=0.5"])
    with pytest.raises(InputError, match=r"uavs.0.camera has no keys; set it as a whole first"):
        load_scenario("forest", ["uavs.0.camera.scale=0.5"])


@pytest.mark.parametrize("fleet", ["uavs.0.camera", "uavs.*.camera", "uavs.0"])
@pytest.mark.parametrize("before", [{}, {"uavs.0.camera": "mavic-3e"}])
def test_a_whole_camera_given_in_python_is_as_one_of_the_command_line(before, fleet):
    camera = {"width": 64, "height": 48, "hfov_deg": 60}
    found = resolve_scenario(
        resolve_scenario("forest", before), {fleet: {"camera": camera} if fleet == "uavs.0" else camera}
    )
    assert found.uavs[0].camera == CameraSettings(**camera) and len(found.uavs) == 3


def test_a_belief_of_a_lens_that_folds_is_told_from_the_lens():
    with pytest.raises(InputError, match=r"^uavs.1.camera: believed: distortion: \[-3.0, .* folds the image over"):
        load_scenario("forest", ["uavs.1.camera={width=640, height=480, hfov_deg=60, believed={distortion=[-3]}}"])


def test_a_camera_info_file_of_ros_is_the_camera_that_opencv_makes_of_it(tmp_path):
    (tmp_path / "info.yaml").write_text(CAMERA_INFO)
    camera = load_scenario(str(scenario_file(tmp_path, '"info.yaml"'))).uavs[0].true_camera
    assert camera.size == (640, 480)
    K = np.array([[438.783367, 0, 305.593336], [0, 437.302876, 243.738352], [0, 0, 1]])
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (1000, 2))
    body = np.column_stack([points, np.ones(1000)])
    expected = cv2.projectPoints(
        body, np.zeros(3), np.zeros(3), K, np.array([-0.361976, 0.11051, 0.001014, 0.000505, 0])
    )
    level = np.column_stack([points[:, 0], -points[:, 1], -np.ones(1000)])
    np.testing.assert_allclose(camera.project(Pose.level(0, 0, 0), level)[0], expected[0][:, 0] + 0.5, atol=1e-6)


def test_the_footprint_is_the_width_of_the_view_on_the_ground():
    for name in CAMERAS:
        for more in ({"footprint": 30.0}, {"altitude": 25.0}):
            uav = UavSettings(start=(0, 0), camera=name, **more).complete()
            camera = uav.true_camera
            ends = np.array([[0.0, camera.optics.cy], [camera.size[0], camera.optics.cy]])
            left, right = camera.ground_points(Pose.level(0.0, 0.0, uav.altitude), ends)
            assert right[0] - left[0] == pytest.approx(uav.footprint, rel=1e-12)
            assert getattr(uav, next(iter(more))) == pytest.approx(next(iter(more.values())), rel=1e-12)
            assert uav.pixels == camera.size[0]


def test_an_angle_of_view_is_that_between_the_ends_of_the_middle_row():
    for distortion in ((), (-0.2, 0.05), (0.1,)):
        camera = make_camera(CameraSettings(width=640, height=480, hfov_deg=70.0, distortion=distortion))
        ends = camera.slopes(np.array([[0.0, 240.0], [640.0, 240.0]]))[:, 0]
        np.testing.assert_allclose(np.degrees(np.arctan(ends)), [-35.0, 35.0], atol=1e-9)


ENDS = {  # of what an angle of view spans, in images of 320 x 240 pixels
    "hfov_deg": [[0.0, 120.0], [320.0, 120.0]],
    "vfov_deg": [[160.0, 0.0], [160.0, 240.0]],
    "dfov_deg": [[0.0, 0.0], [320.0, 240.0]],
}


@pytest.mark.parametrize("key", ENDS)
@pytest.mark.parametrize(
    "lens",
    [
        *((c, "plumb_bob") for c in ((), (-0.2, 0.05), (-0.1, 0.02, 0.004, -0.006), (0.0, 0.0, 0.0, 0.003))),
        ((0.4, -0.2, 0.001, 0.0, 0.1, 0.5, -0.1, 0.02), "rational_polynomial"),
        ((0.02, -0.01), "equidistant"),
    ],
)
@pytest.mark.parametrize("centre", [None, (310.0, 255.0), (200.0, 239.5), (640.0, 239.5)])
@pytest.mark.parametrize("angle", [12.0, 50.0])
def test_an_angle_of_view_is_kept_by_lenses_out_of_the_middle_and_askew(lens, centre, angle, key):
    view = {"width": 640, "height": 480, "centre": centre, "scale": 0.5, key: angle}
    given = CameraSettings(**view, distortion=lens[0], distortion_model=lens[1])
    one, other = (np.append(ray, 1.0) for ray in make_camera(given).slopes(np.array(ENDS[key])))
    cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(angle, abs=1e-6)


def test_a_focal_length_in_millimetres_is_of_the_width_of_the_sensor():
    mavic = CameraSettings(5280, 3956, focal_mm=12.29, sensor_width_mm=17.3)
    camera = make_camera(mavic)
    assert camera.optics.fx == camera.optics.fy == pytest.approx(12.29 / (17.3 / 5280), rel=1e-12)
    ends = camera.slopes(np.array([[0.0, 1978.0], [5280.0, 1978.0]]))[:, 0]
    assert np.ptp(ends) == pytest.approx(17.3 / 12.29, rel=1e-12)


def test_a_fleet_may_believe_another_lens(tmp_path):
    table = {"width": 640, "height": 480, "focal": (500.0, 500.0), "distortion_model": "equidistant"}
    believed = {"distortion": (), "distortion_model": "plumb_bob"}
    given = msgspec.convert({**table, "believed": believed}, CameraSettings)
    assert make_camera(given).is_bent and not make_camera(given, believed=True).is_bent
    with pytest.raises(ValueError, match="believed: distortion_model: 'plumb_bob' needs its own distortion"):
        msgspec.convert({**table, "believed": {"distortion_model": "plumb_bob"}}, CameraSettings)


def test_a_scaled_camera_sees_the_same_rays():
    whole = CameraSettings(width=5280, height=3956, focal=(3713.29, 3713.29), centre=(2646.5, 1968.8), scale=0.5)
    camera, half = make_camera(msgspec.structs.replace(whole, scale=0.75)), make_camera(whole)
    assert camera.size == (3960, 2967) and half.size == (2640, 1978)
    np.testing.assert_allclose(camera.slopes(camera.corners), half.slopes(half.corners), rtol=1e-12)


def test_a_fleet_may_believe_another_calibration():
    table = {"width": 640, "height": 480, "focal": (500.0, 500.0), "distortion": (-0.2,)}
    given = msgspec.convert({**table, "believed": {"distortion": (0.0,), "centre": (300.0, 240.0)}}, CameraSettings)
    true, believed = make_camera(given), make_camera(given, believed=True)
    assert true == make_camera(CameraSettings(**table))
    assert not believed.is_bent and believed.optics.cx == 300.5 and believed.optics.fx == 500.0


def test_a_recorded_scenario_holds_its_camera_whole(tmp_path):
    (tmp_path / "own.toml").write_text('width = 320\nheight = 200\nhfov_deg = 60\ndistortion = [-0.1]\nsource = "me"\n')
    scenario = load_scenario(str(scenario_file(tmp_path, '"own.toml"')))
    (tmp_path / "own.toml").unlink()
    again = decode_recorded(encode_scenario(scenario))
    assert again == scenario and again.uavs[0].camera.source == "me"
    assert resolve_scenario(scenario, {"uavs.0.footprint": 20.0}).uavs[0].altitude == pytest.approx(
        scenario.uavs[0].altitude * 20 / 30
    )
    assert '"camera":' not in encode_scenario(Scenario())


def test_files_are_found_beside_the_scenario_and_overrides_here(tmp_path, monkeypatch):
    inner = tmp_path / "inner"
    inner.mkdir()
    for folder, width in ((tmp_path, 100), (inner, 200)):
        (folder / "own.toml").write_text(f"width = {width}\nheight = 50\nhfov_deg = 60\n")
    path = scenario_file(inner, '"own.toml"')
    monkeypatch.chdir(tmp_path)
    assert load_scenario(str(path)).uavs[0].pixels == 200
    assert load_scenario(str(path), ['uavs.0.camera="own.toml"']).uavs[0].pixels == 100
    assert load_scenario(str(path), ['uavs.0.camera="d435"']).uavs[0].pixels == 640


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        ('"mavik-3e"', "uavs.0: camera: 'mavik-3e' is unknown; allowed are .*; did you mean mavic-3e"),
        ('"none.toml"', "uavs.0: camera: there is no file .*none.toml"),
        (
            "{width = 640, height = 480, focal = [400, 400], distortion = [-0.5]}",
            r"uavs.0.camera: distortion: \[-0.5, 0.0, 0.0, 0.0, 0.0\] folds the image over; ",
        ),
        *(
            (f"{{width = 640, height = 480, hfov_deg = 60, {lens}}}", "distortion: .* folds the image over")
            for lens in ("distortion = [-2.5]", "distortion = [0, -6.0]", "distortion = [-2.5], centre = [300, 200]")
        ),
        ("{width = 640, height = 480, hfov_deg = 60, centre = [900, 240]}", "centre: .* spans no hfov_deg of 60"),
        ("{width = 640, height = 480, vfov_deg = 60, centre = [320, 900]}", "centre: .* spans no vfov_deg of 60"),
        ("{width = 640, height = 480, hfov_deg = 60, dfov_deg = 75}", "hfov_deg and focal: one of them is needed, "),
        ("{width = 640, height = 480}", "uavs.0.camera: hfov_deg and focal: .*; or vfov_deg, dfov_deg, or focal_mm wi"),
        ("{width = 640, height = 480, focal_mm = 8.4}", "focal_mm and sensor_width_mm: both are needed, or neither"),
        (
            "{width = 640, height = 480, hfov_deg = 60, distortion = [0.1, 0, 0, 0, 0, 0.1]}",
            "distortion: .* has more than the 5 coefficients of plumb_bob; rational_polynomial has 8",
        ),
        (
            '{width = 640, height = 480, hfov_deg = 155, distortion_model = "equidistant"}',
            "hfov_deg: 155 is not allowed; expected at most 151, as equidistant lenses show here",
        ),
        ('{width = 64, height = 48, hfov_deg = 60, distortion_model = "fisheye"}', "distortion_model: .*fisheye"),
        (
            "{width = 640, height = 480, hfov_deg = 60, scale = 0.01}",
            "uavs.0.camera: scale: 0.01 gives images of 6 pix",
        ),
    ],
)
def test_a_wrong_camera_is_told_in_one_line(tmp_path, camera, message):
    with pytest.raises(InputError, match=message) as error:
        load_scenario(str(scenario_file(tmp_path, camera)))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("438.783367", "0.0", "camera_matrix: .* is singular or skew; expected fx, 0, cx, 0, fy, cy, 0, 0, 1"),
        ("plumb_bob", "omnidirectional", "distortion_model: 'omnidirectional' is not allowed; expected plumb_bob"),
        ("image_width: 640", "image_width: [", "is no YAML: "),
    ],
)
def test_a_wrong_camera_info_file_is_told_in_one_line(tmp_path, old, new, message):
    assert old in CAMERA_INFO
    (tmp_path / "info.yaml").write_text(CAMERA_INFO.replace(old, new))
    with pytest.raises(InputError, match=message) as error:
        read_camera(str(tmp_path / "info.yaml"))
    assert "\n" not in str(error.value)


def test_a_camera_rules_out_other_views(tmp_path):
    for more, message in (
        ("fov_deg = 60", "fov_deg 60 is not that of the camera, 49"),
        ("pixels = 256", "pixels 256 is not the width of the camera's images, 640"),
        ("altitude = 20", "footprint, fov_deg and altitude are given"),
        ("tilt_deg = 58\n[sensing]\nmode = 'ideal'", None),
        ("tilt_deg = 60\nfootprint2 = 1", "unknown key"),
    ):
        path = scenario_file(tmp_path, '"thermal-640"', more)
        if message is None:
            load_scenario(str(path))
            continue
        with pytest.raises(InputError, match=message):
            load_scenario(str(path))
    wide = "{width = 640, height = 640, hfov_deg = 80}"
    with pytest.raises(InputError, match=r"tilt_deg 55 lets the camera look at the horizon; allowed .* less than 50"):
        load_scenario(str(scenario_file(tmp_path, wide, "tilt_deg = 55")))
