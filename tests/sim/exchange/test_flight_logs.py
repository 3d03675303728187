"""Each dialect of a log against the flight that was made up for it, and what is refused, or asked for, in one line."""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.made_logs import find_angles, make_dataflash, make_ulog
from scipy.spatial.transform import Rotation

from sim.exchange.flight_logs import find_logs
from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import track_flight
from sim.exchange.values import find_attitudes
from sim.scenario.geo import Geo
from tracking.errors import InputError

LOGS = Path(__file__).parents[2] / "data" / "logs"
K = np.arange(6)
LATITUDES, LONGITUDES, HEIGHTS = 50 + 2e-5 * K, -8 + 3e-5 * K, 30 + 0.5 * K
YAW, PITCH, ROLL = (350.0 + 4 * K) % 360, -60.0 - K, np.full(6, 0.5)
START = 1714557604.0  # 2024-05-01 10:00:04 UTC
CAMERA = "uav,hfov_deg,width_px,height_px{},axes\n0,60,640,480{},{}\n"
NADIR = (",yaw_deg,pitch_deg", ",0,-90", "")


def write(folder, log, camera=("", "", ""), name=None, epoch=0.0, dt=0.2):
    """A flight with a log and a person straight below its camera, seen in each frame."""
    folder.mkdir(exist_ok=True)
    if isinstance(log, bytes):
        (folder / name).write_bytes(log)
    else:
        shutil.copy(LOGS / log, folder / log)
    (folder / "cameras.csv").write_text(CAMERA.format(*camera))
    rows = [f"{epoch + dt * k!r},{50 + 2e-5 * k},{-8 + 3e-5 * k}" for k in range(6)]
    (folder / "detections.csv").write_text("\n".join(["time_s,latitude,longitude", *rows]) + "\n")
    return folder


def poses_of(folder, *overrides):
    """Places [deg], heights [m] and attitudes of the camera at frames."""
    flight = read_flight(folder, overrides=overrides)
    poses = flight.poses[flight.frames[:, 0], 0]
    return flight.setting.geo.find_degrees(poses[:, :2]), poses[:, 2], poses[:, 3:], flight.remarks


SUBTITLES = {  # what heights are above, seconds between blocks, whether there are angles
    "mavic3.srt": ("start", 0.2, False),
    "mavic3-enterprise.srt": ("start", 0.2, True),
    "air2s.srt": ("sea", 0.2, False),
    "mavic2.srt": ("sea", 0.2, False),
    "mavic-pro.srt": ("start", 1.0, False),
    "first.srt": ("start", 1.0, False),
    "mini.srt": ("start", 1.0, False),
    "phantom4-rtk.srt": ("start", 1.0, True),
    "matrice300.srt": ("start", 1.0, False),
}


@pytest.mark.parametrize("name", SUBTITLES)
def test_subtitles_of_dji_hold_the_flight_in_every_dialect(name, tmp_path):
    above, dt, angles = SUBTITLES[name]
    folder = write(tmp_path / "flight", name, ("", "", "") if angles else NADIR, dt=dt)
    (found,) = find_logs(folder).values()
    dated = name not in ("mini.srt", "phantom4-rtk.srt")
    assert found.format == "DJI SRT" and found.above == above
    np.testing.assert_equal(found.epoch, START if dated else np.nan)
    places, heights, attitudes, remarks = poses_of(folder, "geo.ground=120")
    np.testing.assert_allclose(places, np.column_stack([LATITUDES, LONGITUDES]), atol=2e-9, rtol=0)
    np.testing.assert_allclose(heights, HEIGHTS, atol=1e-4)
    expected = [YAW, PITCH, ROLL] if angles else [0 * K, 0 * K - 90, 0 * K]
    same = Rotation.from_quat(attitudes).inv() * Rotation.from_quat(find_attitudes(np.column_stack(expected)))
    assert np.degrees(same.magnitude()).max() < 1e-6
    assert any(f"above the {above}" in remark for remark in remarks)


@pytest.mark.parametrize("name", ["mavic3.srt", "air2s.srt"])
def test_heights_above_start_or_sea_become_heights_above_rising_ground(name, tmp_path):
    above, dt, _ = SUBTITLES[name]
    folder = write(tmp_path / "flight", name, NADIR, dt=dt)
    rise = 0.05 * np.arange(200.0)  # m, from column to column, to the east
    head = "ncols 200\nnrows 200\nxllcenter -8.001\nyllcenter 49.999\ncellsize 0.00001\n"
    (folder / "dem.asc").write_text(head + "\n".join([" ".join(f"{110 + h:.2f}" for h in rise)] * 200))
    _, heights, _, remarks = poses_of(folder, "ground.file=dem.asc")
    ground = 110 + 0.05 * (LONGITUDES + 8.001) / 0.00001
    np.testing.assert_allclose(heights, HEIGHTS + (120 if above == "sea" else ground[0]) - ground, atol=2e-3)
    assert any(f"heights are above the {above}, " in remark for remark in remarks)


@pytest.mark.parametrize(("name", "focal"), [("mavic3.srt", 24.0), ("air2s.srt", 22.4), ("mavic2.srt", 28.0)])
def test_focal_lengths_are_in_millimetres_tenths_or_hundredths(name, focal, tmp_path):
    shutil.copy(LOGS / name, tmp_path / name)
    assert find_logs(tmp_path)[0].focal == focal


def test_rows_before_an_earlier_one_or_without_a_time_are_left_out(tmp_path):
    lines = (LOGS / "airdata-metres.csv").read_text().splitlines()
    folder = write(tmp_path / "flight", "airdata-metres.csv")
    at = lines[0].split(",").index("time(millisecond)")
    rows = [line.split(",") for line in lines[1:]]
    early = [*rows[0][:at], str(float(rows[1][at]) - 1), *rows[0][at + 1 :]]
    untimed = [*rows[0][:at], "", *rows[0][at + 1 :]]
    changed = [*rows[:3], early, *rows[3:], untimed]
    (folder / "airdata-metres.csv").write_text("\n".join([lines[0], *map(",".join, changed)]) + "\n")
    plain, mended = (poses_of(f) for f in (write(tmp_path / "plain", "airdata-metres.csv"), folder))
    for one, other in zip(plain[:3], mended[:3], strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_block_cut_within_its_times_is_left_out(tmp_path):
    text = (LOGS / "mavic3.srt").read_text("utf-8")
    for name, tail in (("plain", ""), ("cut", "\n\n12\n00:00:11,000 --> 00:0")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.srt").write_text(text.rstrip() + tail, "utf-8")
    plain, cut = (next(iter(find_logs(tmp_path / name).values())) for name in ("plain", "cut"))
    np.testing.assert_array_equal(plain.places, cut.places)


def test_blocks_that_are_broken_or_without_a_fix_are_counted(tmp_path):
    for name, lost in (("mavic2.srt", "1 of 7"), ("mavic-pro.srt", "1 of 6")):
        shutil.copy(LOGS / name, tmp_path / name)
        (log,) = (one for one in find_logs(tmp_path).values() if one.path.name == name)
        assert any(f"left out: {lost} blocks" in remark for remark in log.remarks)


@pytest.mark.parametrize("name", ["airdata-feet.csv", "airdata-metres.csv"])
@pytest.mark.parametrize("epoch", [0.0, START + 1])
def test_airdata_is_read_in_feet_and_metres_from_the_start_of_the_video_or_by_utc(name, epoch, tmp_path):
    places, heights, attitudes, remarks = poses_of(write(tmp_path / "flight", name, epoch=epoch))
    np.testing.assert_allclose(places, np.column_stack([LATITUDES, LONGITUDES]), atol=2e-9, rtol=0)
    np.testing.assert_allclose(heights, HEIGHTS, atol=0.002)
    same = Rotation.from_quat(attitudes).inv() * Rotation.from_quat(find_attitudes(np.column_stack([YAW, PITCH, ROLL])))
    assert np.degrees(same.magnitude()).max() < 1e-6
    assert any("its video begins at 1 s" in remark for remark in remarks) == (epoch == 0)


@pytest.mark.parametrize("name", ["tum.txt", "euroc.csv"])
def test_trajectories_have_optical_axes_and_their_own_order_of_quaternions(name, tmp_path):
    folder = write(tmp_path / "flight", name, epoch=1714557600.0)
    (folder / "detections.csv").write_text(
        "time_s,x_m,y_m\n" + "".join(f"{1714557600 + 0.2 * k},0,0\n" for k in range(6))
    )
    flight = read_flight(folder)
    np.testing.assert_allclose(flight.poses[:, 0, :3], np.column_stack([1.5 * K, -0.5 * K, 20 + 0.1 * K]), atol=1e-9)
    yaw, pitch, roll = find_angles(flight.poses[:, 0, 3:]).T
    np.testing.assert_allclose([(yaw + roll), pitch], [10.0 * K, 0 * K - 90], atol=1e-6)


BODY = np.column_stack([YAW, 3.0 + K, -2.0 * np.ones(6)])  # yaw, pitch and roll of a body to north-east-down


def axes_of_body(yaw, pitch, roll):
    """Ahead and right of a body, as east, north and up."""
    y, p, r = np.radians([yaw, pitch, roll])
    ahead = np.array([np.cos(p) * np.sin(y), np.cos(p) * np.cos(y), np.sin(p)])
    north = np.sin(r) * np.sin(p) * np.cos(y) - np.cos(r) * np.sin(y)
    east = np.sin(r) * np.sin(p) * np.sin(y) + np.cos(r) * np.cos(y)
    return ahead, np.array([east, north, -np.sin(r) * np.cos(p)])


def check_body(attitudes):
    """A camera that looks down from the body."""
    for (yaw, pitch, roll), attitude in zip(BODY, attitudes, strict=True):
        ahead, right = axes_of_body(yaw, pitch, roll)
        np.testing.assert_allclose(
            Rotation.from_quat(attitude).apply([[1.0, 0, 0], [0, 1, 0]]), [right, ahead], atol=2e-4
        )


def make_px4(tmp_path, *, globe):
    q = np.roll(Rotation.from_euler("ZYX", BODY, degrees=True).as_quat(), 1, axis=1).tolist()
    origin = Geo(origin=(50.0, -8.0))
    east, north = origin.find_metres(LATITUDES, LONGITUDES).T
    times = (5_000_000 + 200_000 * K).tolist()
    topics = {
        "vehicle_local_position": [
            (t, 50.0, -8.0, n, e, -h - 1, True) for t, n, e, h in zip(times, north, east, HEIGHTS, strict=True)
        ],
        "vehicle_attitude": [(t, *turn) for t, turn in zip(times, q, strict=True)],
        "vehicle_gps_position": [(times[0], int((START + 0.0) * 1e6))],
        "home_position": [(times[0], -1.0)],
    }
    if globe:
        rows = zip(times, LATITUDES.tolist(), LONGITUDES.tolist(), strict=True)
        topics["vehicle_global_position"] = [(t, lat, lon, 150.0) for t, lat, lon in rows]
    return write(tmp_path / "flight", make_ulog(topics), name="log.ulg", epoch=START)


@pytest.mark.parametrize("globe", [True, False])
def test_a_ulog_has_its_places_heights_above_home_and_the_attitude_of_the_body(globe, tmp_path):
    pytest.importorskip("pyulog")
    places, heights, attitudes, remarks = poses_of(make_px4(tmp_path, globe=globe))
    np.testing.assert_allclose(places, np.column_stack([LATITUDES, LONGITUDES]), atol=1e-8, rtol=0)
    np.testing.assert_allclose(heights, HEIGHTS, atol=1e-5)
    check_body(attitudes)
    assert any("the camera is taken to look down from the body" in remark for remark in remarks)


def make_ardupilot(tmp_path, *, text, mount=False):
    rows = []
    week, rest = divmod(START + 18 - 315964800, 604800)  # by GPS, which is ahead of UTC by leap seconds
    for k in range(6):
        time = 7_000_000 + 200_000 * k
        place = (LATITUDES[k], LONGITUDES[k])
        rows.append(("GPS", time, 0, 3, int((rest + 0.2 * k) * 1000), int(week), 15, 1.0, *place, 150.0))
        rows.append(("ATT", time, 0.0, BODY[k, 2], 0.0, BODY[k, 1], 0.0, BODY[k, 0]))
        if mount:
            rows.append(("MNT", time, 0, 0.0, ROLL[k], 0.0, PITCH[k], 0.0, 0.0, YAW[k]))
        rows.append(("POS", time, *place, 150.0, HEIGHTS[k], HEIGHTS[k] + 0.3))
    name = "00000012.log" if text else "00000012.BIN"
    return write(tmp_path / "flight", make_dataflash(rows, text=text), name=name, epoch=START)


@pytest.mark.parametrize("text", [True, False])
@pytest.mark.parametrize("mount", [True, False])
def test_logs_of_ardupilot_are_read_binary_and_as_text_with_body_or_mount(text, mount, tmp_path):
    pytest.importorskip("pymavlink")
    places, heights, attitudes, _ = poses_of(make_ardupilot(tmp_path, text=text, mount=mount))
    np.testing.assert_allclose(places, np.column_stack([LATITUDES, LONGITUDES]), atol=6e-8, rtol=0)
    np.testing.assert_allclose(heights, HEIGHTS, atol=1e-5)
    if mount:
        expected = Rotation.from_quat(find_attitudes(np.column_stack([YAW, PITCH, ROLL])))
        assert np.degrees((Rotation.from_quat(attitudes).inv() * expected).magnitude()).max() < 1e-4
    else:
        check_body(attitudes)


REFUSED = {
    "00.csv": ("OSD.flyTime,OSD.latitude,OSD.height [ft]\n1,2,3\n", "DJI's flight record as CSV.*give AirData's CSV"),
    "a.kml": ('<?xml version="1.0"?>\n<kml xmlns="x"></kml>', "KML, which is not read"),
    "images.txt": ("# Image list with two lines of data per image:\n", "COLMAP's images.txt, which is not read; give"),
    "cameras.txt": ("# Camera list with one line of data per camera:\n", "COLMAP's cameras.txt.*give cameras.csv"),
    "FLY001.DAT": ("\0" * 16 + "BUILD 2020\n", "DJI's DAT log, which is not read; give the video's SRT"),
    "a.tlog": ("x", "is of a ground station, which is not read; give the drone's own log"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_read_is_refused_by_name(name, tmp_path):
    text, told = REFUSED[name]
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=told):
        find_logs(tmp_path)


def feet_without_unit(folder):
    path = folder / "airdata-feet.csv"
    path.write_text(path.read_text().replace("height_above_takeoff(feet)", "height_above_takeoff"))


def far_trees(folder):
    (folder / "trees.csv").write_text("latitude,longitude,height\n50.09,-8,9\n50.09,-8.0001,9\n")


def swapped(folder):
    rows = [f"{0.2 * k!r},{-8 + 3e-5 * k},{50 + 2e-5 * k}" for k in range(6)]
    (folder / "detections.csv").write_text("\n".join(["time_s,latitude,longitude", *rows]) + "\n")


def west(folder):
    (folder / "detections.csv").write_text("time_s,latitude,longitude\n0,149.02,-20.2\n")


WRONG = {
    "no gimbal": ("mavic3.srt", None, r"no angles of a gimbal; give cameras.csv the columns yaw_deg and pitch_deg"),
    "no height": ("without-heights.srt", None, r"no heights; give cameras.csv a column height_m"),
    "above the sea": ("air2s.srt", None, r"give --set geo.ground=G, of the ground above the sea; they are 151.2 m"),
    "feet": ("airdata-feet.csv", feet_without_unit, r"tells no unit; call it height_above_takeoff\(feet\) or"),
    "two origins": ("mavic3-enterprise.srt", far_trees, r"trees.csv, line 2, .* is 10.0 km from geo.origin, 50.0000"),
    "swapped": ("mavic3-enterprise.srt", swapped, r"km from geo.origin.*are latitude and longitude swapped\?"),
    "beyond 90": ("mavic3-enterprise.srt", west, r"a latitude of 149.02 is not allowed.*swapped\?"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_or_missing_values_are_one_line_that_says_what_to_change(case, tmp_path):
    name, spoil, told = WRONG[case]
    folder = write(tmp_path / "flight", name)
    if spoil:
        spoil(folder)
    with pytest.raises(InputError) as caught:
        read_flight(folder)
    assert re.search(told, str(caught.value)) and "\n" not in str(caught.value)


def test_cameras_may_say_what_a_log_lacks(tmp_path):
    camera = (",yaw_deg,pitch_deg,height_m,pose_offset_s", ",90,-90,25,-0.2", "")
    places, heights, attitudes, _ = poses_of(write(tmp_path / "flight", "without-heights.srt", camera))
    np.testing.assert_allclose(heights, 25.0)
    np.testing.assert_allclose(places[:5, 0], LATITUDES[1:], atol=2e-9)
    np.testing.assert_allclose(Rotation.from_quat(attitudes[0]).apply([0, 1.0, 0]), [1, 0, 0], atol=1e-9)


def test_logs_of_several_uavs_go_by_their_numbers_and_poses_csv_goes_first(tmp_path):
    folder = write(tmp_path / "flight", "mavic3-enterprise.srt")
    (folder / "mavic3-enterprise.srt").rename(folder / "uav1.srt")
    shutil.copy(LOGS / "phantom4-rtk.srt", folder / "uav0.srt")
    assert {i: one.path.name for i, one in find_logs(folder).items()} == {0: "uav0.srt", 1: "uav1.srt"}
    with pytest.raises(InputError, match=r"logs are uav0\.srt, uav1\.srt, but no camera of UAV 1; a UAV has one log"):
        read_flight(folder)
    (folder / "poses.csv").write_text("time_s,x_m,y_m,z_m\n0,0,0,30\n")
    assert "logs: not used: uav0.srt, uav1.srt, as there is poses.csv" in read_flight(folder).remarks


@pytest.mark.parametrize(("zone", "clock"), [("Z", 0.0), ("-02:00", 7200.0)])
def test_people_of_a_gpx_file_are_there_at_the_date_of_the_subtitles(zone, clock, tmp_path):
    """The drone's clock has no zone; `clock_offset_s` says how far it is from UTC."""
    folder = write(tmp_path / "flight", "mavic3-enterprise.srt", (",clock_offset_s", f",{clock}", ""))
    text = (LOGS / "people.gpx").read_text()
    (folder / "truth.gpx").write_text(text.replace("Z</time>", f"{zone}</time>"))
    flight = read_flight(folder)
    k = np.arange(2)
    ada = flight.setting.geo.find_metres(50 + 1e-5 * k, -8 + 1e-5 * k)
    np.testing.assert_allclose([flight.people.at(float(t))[0][0] for t in k], ada, atol=1e-5)
    assert any("times of people are since 1970" in remark for remark in flight.remarks)
    assert track_flight(flight).recording.matched.shape == (6, 1, 2)


def test_what_a_log_holds_beside_the_frames_does_not_count(tmp_path):
    """A log of a whole flight: on the ground and 3 km away before the frames, and after them."""
    folder = write(tmp_path / "flight", "airdata-metres.csv", epoch=START + 1)
    lines = (folder / "airdata-metres.csv").read_text().splitlines()
    ground = [line.replace(line.split(",")[2], "50.03").split(",") for line in lines[1:3]]
    before = [[str(time), *row[1:4], "0", *row[5:]] for time, row in zip((0, 200), ground, strict=True)]
    before[0][1] = before[1][1] = "2024-05-01 10:00:04"
    rows = [lines[0], *map(",".join, before), *lines[1:]]
    (folder / "airdata-metres.csv").write_text("\n".join(rows) + "\n")
    flight = read_flight(folder, overrides=["geo.origin=[50.0,-8.0]"])
    assert flight.setting.area.height < 400
    np.testing.assert_allclose(flight.poses[flight.frames[:, 0], 0, 2], HEIGHTS, atol=0.01)
    assert any("10 poses from 0 to 2 s" in remark for remark in flight.remarks)


BROKEN = {
    "a.ulg": (b"ULog\x01\x12\x35\x01" + bytes(40), "has no vehicle_local_position, or no vehicle_attitude; log both"),
    "a.bin": (b"\xa3\x95\x80" + bytes(100), "has no messages POS or GPS, or no ATT"),
    "a.srt": (b"1\n00:00:00,000 --> 00:00:01,000\nHello\n", "has no latitude and longitude; switch on video captions"),
    "a.csv": (b"time(millisecond),latitude\n1,2\n", "line 1: column longitude is missing"),
    "a.txt": (b"1 2 3 4 5 6 7 8\n1 2 3 4 5 6 7 8\n1 2 3\n", "3 columns"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_logs_are_one_line(name, tmp_path, capsys):
    pytest.importorskip("pyulog")
    pytest.importorskip("pymavlink")
    content, told = BROKEN[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=f"log: .*{told}") as caught:
        find_logs(tmp_path)
    assert "\n" not in str(caught.value) and capsys.readouterr().out == ""


@pytest.mark.parametrize(("name", "library"), [("a.ulg", "pyulog"), ("a.bin", "pymavlink")])
def test_a_library_that_is_missing_is_named(name, library, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.setitem(sys.modules, f"{library}.DFReader", None)
    (tmp_path / name).write_bytes(BROKEN[name][0])
    with pytest.raises(InputError, match=f"needs {library}: pip install {library}"):
        find_logs(tmp_path)
