"""Columns, units and axes of flights that are not as they seem: told in one line, with what mends it."""

import math
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sim.exchange.scanned_flight import read_flight
from tracking.errors import InputError

TIMES = np.arange(0, 40, 0.2)
PLACES = 30 * np.column_stack([np.sin(0.2 * TIMES), np.cos(0.2 * TIMES)])  # m, clockwise round a circle
COURSE = math.pi / 2 + 0.2 * TIMES  # rad, clockwise from north
UP = np.array([0.0, 0.0, 1.0])
BELOW = np.diag([1.0, -1.0, -1.0])
# Attitudes of a camera that looks straight down and has its course at the top of images, in several axes.
AXES = {
    "image": Rotation.from_rotvec(UP * -COURSE[:, None]),
    "optical": Rotation.from_rotvec(UP * -COURSE[:, None]) * Rotation.from_matrix(BELOW),
    "flu": Rotation.from_rotvec(UP * (math.pi / 2 - COURSE[:, None])),
    "frd": Rotation.from_rotvec(UP * COURSE[:, None]),
}
QUATERNION = "time_s,x_m,y_m,z_m,qx,qy,qz,qw"
SEEN = ["time_s,x_m,y_m", "0,1,1", "1,,", "2,,", "3,1,1"]


@pytest.fixture
def told(tmp_path):
    """Writes a flight of one UAV and reads it: its files, those of changed ones, and the overrides of its scenario."""

    def read(header, rows, overrides=(), **files):
        lines = [header, *(",".join(map(str, [*row])) for row in rows)]
        plain = {"poses": lines, "detections": SEEN, "cameras": ["fov_deg,pixels", "60,128"]}
        for name, text in (plain | files).items():
            (tmp_path / f"{name}.csv").write_text("\n".join(text) + "\n", encoding="utf-8")
        return read_flight(tmp_path, overrides=overrides)

    return read


def posed(places=PLACES, height=20.0, more=None):
    """Rows of poses with these heights [m] and further entries (P, n)."""
    more = np.zeros((len(TIMES), 0)) if more is None else more
    return [[t, *place, height, *rest] for t, place, rest in zip(TIMES, places.tolist(), more.tolist(), strict=True)]


def angles(factor):
    return np.column_stack([COURSE % 6.2 * factor, np.full(len(TIMES), -1.55 * factor)])


PLAIN = "time_s,x_m,y_m,z_m"
DOUBTS = [
    (f"{PLAIN},heading_deg", posed(more=angles(1)[:, :1]), "poses: not used: column heading_deg; attitudes have the"),
    (f"{PLAIN},yaw,pitch", posed(more=angles(57.3)), "poses: not used: columns yaw, pitch; attitudes have the"),
    (f"{PLAIN},yaw_deg", posed(more=angles(57.3)[:, :1]), "poses: without the column pitch_deg, cameras look straight"),
    (f"{PLAIN},yaw_deg,pitch_deg", posed(more=angles(1)), "always looks at the horizon in the north; are yaw_deg"),
    (PLAIN, posed([11.57, 48.1] + PLACES / 1e5), "poses: all places are within 0.02 m; are x_m and y_m in degrees?"),
    (PLAIN, posed(100 * PLACES), "poses: UAV 0 flies at 600 m/s in the median; are places in metres"),
    (PLAIN, posed(height=520), "poses: UAV 0 is 520 m high in the median; are heights in metres above the ground"),
    (QUATERNION, posed(more=AXES["flu"].as_quat()), "of a body with x ahead; if they are, give cameras.csv"),
    (QUATERNION, posed(more=AXES["frd"].as_quat()), "as PX4 logs them; if they are, give cameras.csv"),
    (QUATERNION, posed(more=np.roll(AXES["image"].as_quat(), 1, axis=1)), "40 % of its poses; are these wxyz?"),
]


@pytest.mark.parametrize(("header", "rows", "doubt"), DOUBTS)
def test_what_is_far_from_any_drone_or_not_used_is_told_in_one_line(told, header, rows, doubt):
    (line,) = [line for line in told(header, rows).remarks if doubt in line]
    assert "\n" not in line


SEEN_ALWAYS = [SEEN[0], *(f"{t},{x + 1},{y}" for t, (x, y) in zip(TIMES, PLACES.tolist(), strict=True))]
LABELS = ["time_s,id,x_m,y_m", *(line.replace(",", ",a,", 1) for line in SEEN_ALWAYS[1:])]
DEGREES = [[100 * row[0], *row[1:]] for row in posed([11.57, 48.1] + PLACES / 1e3)]  # a circle of 3 km
ODD = {  # poses, other files, and what is told
    "kilometres of degrees": (DEGREES, {"detections": SEEN[:3]}, "poses: UAV 0 flies at 6e-05 m/s in the median; are"),
    "kilometres": (
        posed(PLACES / 1e3),
        {"detections": [SEEN[0], *(f"{t},0.003,0.03" for t in TIMES[:12])]},
        "detections: those of UAV 0 are 0.0036 m from the place below it in the median; are places in metres?",
    ),
    "radians over a width": (
        posed(),
        {"cameras": ["hfov_deg,width_px,height_px", "1.4,192,128"]},
        "cameras: hfov_deg of UAV 0 is 1.4; is it in degrees?",
    ),
    "x for y": (
        posed(),
        {"detections": [SEEN[0], "0,30,0", "1,29.4,6", "2,27,11.7", "3,17,25"]},
        "detections: 3 of 4 are outside the views of their cameras; do places, poses",
    ),
    "people who are known for a while": (
        posed(),
        {"detections": SEEN_ALWAYS, "truth": LABELS[:16]},
        "truth: people are there from 0 to 2.88 s, and frames from 0 to 39.8 s; tracks at other times count as false",
    ),
    "poses that end early": (
        posed()[:-8],
        {"detections": SEEN_ALWAYS},
        "poses: 8 frames of UAV 0 before the first pose or after the last, by up to 1.6 s; such frames have that pose",
    ),
    "frames that are missing": (posed(), {"detections": SEEN_ALWAYS[:9] + SEEN_ALWAYS[20:]}, "list those without, too"),
    "frames at the end of a flight": (posed(), {"detections": [SEEN[0], *SEEN_ALWAYS[99:]]}, "list those without, too"),
}


@pytest.mark.parametrize("name", ODD)
def test_files_that_do_not_fit_together_are_told_of_in_one_line(told, name):
    rows, files, doubt = ODD[name]
    (line,) = [line for line in told(PLAIN, rows, **files).remarks if doubt in line]
    assert "\n" not in line


def of_three(rows):
    """A header or rows of one UAV, as those of three."""
    return [[row[0], i, *row[1:]] for row in rows for i in range(3)]


ALIKE = {  # poses, the camera's row, frames until then, and the only remark on what the three have in common
    "height": (
        posed(height=520),
        "60,128,,",
        40,
        "poses: UAV 0 is 520 m high in the median (UAVs 1 and 2 likewise); a",
    ),
    "speed": (
        posed(100 * PLACES),
        "60,128,,",
        40,
        "poses: UAV 0 flies at 600 m/s in the median (UAVs 1 and 2 likewise",
    ),
    "angle": (
        posed(),
        "1.05,128,,",
        40,
        "cameras: fov_deg of UAV 0 is 1.05 (UAVs 1 and 2 likewise); is it in degrees?",
    ),
    "missing": (
        posed(),
        "60,128,,",
        20,
        "detections: each frame of UAV 0 has a detection (UAVs 1 and 2 likewise); list",
    ),
    "poses": (
        posed()[:-8],
        "60,128,,",
        40,
        "poses: 8 frames of UAV 0 before the first pose or after the last, by up to",
    ),
    "edges": (
        posed(),
        "40,108,192,108",
        40,
        "cameras: UAVs 0, 1 and 2: fov_deg 40 is over 108 pixels in the middle of",
    ),
}


@pytest.mark.parametrize("name", ALIKE)
def test_what_several_uavs_have_in_common_is_told_once(told, name):
    rows, camera, end, doubt = ALIKE[name]
    seen = [line.split(",") for line in SEEN_ALWAYS[1:] if float(line.split(",")[0]) < end]
    files = {
        "cameras": ["uav,fov_deg,pixels,width_px,height_px", *(f"{i},{camera}" for i in range(3))],
        "detections": ["time_s,uav,x_m,y_m", *(",".join(map(str, row)) for row in of_three(seen))],
    }
    remarks = told("time_s,uav,x_m,y_m,z_m", of_three(rows), **files).remarks
    (line,) = [line for line in remarks if line.startswith(doubt.split()[0]) and "UAV" in line]
    assert line.startswith(doubt) and ("UAVs 1 and 2 likewise" in line or name == "edges")


@pytest.mark.parametrize("fails_at", [20, 30])
def test_a_uav_that_breaks_down_lacks_no_frames_and_those_after_it_are_left_out(told, fails_at):
    """As of an exported mission, whose poses go on."""
    until = [SEEN_ALWAYS[0], *(line for line in SEEN_ALWAYS[1:] if float(line.split(",")[0]) < fails_at)]
    missing = [any("list those without" in line for line in told(PLAIN, posed(), detections=until).remarks)]
    broken = [f"uavs.0.fails_at={fails_at}"]
    log = told(PLAIN, posed(), broken, detections=until)
    missing.append(any("list those without" in line for line in log.remarks))
    assert missing == [True, False] and not any("fails_at" in line for line in log.remarks)
    more = told(PLAIN, posed(), broken, detections=SEEN_ALWAYS)
    np.testing.assert_array_equal(more.frames[: len(log.frames)], log.frames)
    assert more.frames.sum() == log.frames.sum() == 5 * fails_at
    left_out = f"uavs.0.fails_at: left out: {200 - 5 * fails_at} frames after UAV 0 breaks down at {fails_at} s"
    assert left_out in more.remarks


@pytest.mark.parametrize("area", [(), ("area.width=20", "area.height=20")])
def test_a_detection_in_each_frame_and_people_who_leave_an_area_are_not_odd(told, area):
    remarks = told(PLAIN, posed(), area, detections=SEEN_ALWAYS, truth=LABELS).remarks
    assert all(line.startswith(("area: ", "detections: those without a covariance")) for line in remarks)


def test_a_body_on_a_straight_course_is_doubted_unless_north_is_up(told):
    """A gimbal that keeps north at the top may fly to any side."""
    for course, doubted in ((0.0, False), (0.7, True)):
        attitude = Rotation.from_rotvec([0.0, 0.0, course]).as_quat()
        along = 5 * TIMES[:, None] * [math.cos(course), math.sin(course)]
        remarks = told(QUATERNION, posed(along, more=np.tile(attitude, (len(TIMES), 1)))).remarks
        assert any("of a body with x ahead; if they are" in line for line in remarks) == doubted


def test_people_and_cameras_of_other_units_are_doubted(told):
    truth = ["time_s,id,x_m,y_m", *(f"{t},{i},{100 * t},{i}" for t in range(4) for i in range(2))]
    found = told(PLAIN, posed(), truth=truth, cameras=["fov_deg,pixels", "1.05,128"])
    assert any("id 0 moves at 100 m/s, but no one has run faster" in line for line in found.remarks)
    assert "cameras: fov_deg of UAV 0 is 1.05; is it in degrees?" in found.remarks


def test_a_usual_flight_is_not_doubted_and_a_comment_may_name_the_columns(told):
    remarks = told(QUATERNION, posed(more=AXES["image"].as_quat())).remarks
    assert not any(line.startswith("poses") for line in remarks)
    names = "# timestamp,tx,ty,tz,qx,qy,qz,qw"
    assert told(names, posed(more=AXES["image"].as_quat())).remarks == remarks
    still = told(f"{PLAIN},yaw_deg,pitch_deg,roll_deg", [[0, 1, 2, 30, 0, 0, 0], [3, 1, 2, 30, 0, 0, 0]])
    assert not any(line.startswith("poses") for line in still.remarks)


@pytest.mark.parametrize("axes", AXES)
def test_quaternions_of_other_axes_give_the_same_poses(told, axes):
    cameras = ["fov_deg,pixels,axes", f"60,128,{axes}"]
    found = told(QUATERNION, posed(more=AXES[axes].as_quat()), cameras=cameras)
    wanted = AXES["image"][0].as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(found.poses[0, 0, 3:]).as_matrix(), wanted, atol=1e-9)
    assert not any(line.startswith("poses") for line in found.remarks)


@pytest.mark.parametrize("axes", AXES)
def test_axes_of_quaternions_are_not_those_of_angles(told, axes):
    header, rows = f"{PLAIN},yaw_deg,pitch_deg", posed(more=np.column_stack([np.degrees(COURSE), 0 * TIMES - 60]))
    cameras = ["fov_deg,pixels,axes", f"60,128,{axes}"]
    turned, plain = told(header, rows, cameras=cameras), told(header, rows)
    np.testing.assert_array_equal(turned.poses, plain.poses)
    unused = f"cameras: not used: column axes, {axes}, which are of quaternions in poses.csv; it has none"
    assert (unused in turned.remarks) == (axes != "image") and unused not in plain.remarks
    with pytest.raises(InputError, match=r"looks above the horizon in each .* and pitch_deg is -90 there$"):
        told(header, [[*row[:5], 90] for row in rows], cameras=cameras)


def test_axes_are_named_by_where_they_look(told):
    tilted = Rotation.from_euler("zx", np.column_stack([-COURSE, np.full(len(TIMES), 0.6)]))
    optical = posed(more=(tilted * Rotation.from_matrix(BELOW)).as_quat())
    with pytest.raises(InputError, match=r"above the horizon in each.* of optical axes, z ahead \(then .*\)\?$"):
        told(QUATERNION, optical)
    cameras = ["fov_deg,pixels,axes", "60,128,optic"]
    with pytest.raises(InputError, match=r"^cameras: column axes: 'optic' is unknown; .*did you mean optical"):
        told(QUATERNION, optical, cameras=cameras)


def test_detections_of_another_unit_or_origin_are_doubted(told):
    far = told(PLAIN, posed(), detections=["time_s,x_m,y_m", "0,7000,1", "1,,", "3,7001,1"])
    assert any("those of UAV 0 are 6992 m away from it in the median" in line for line in far.remarks)
    rows = [f"{t},{11.57 + 1e-5 * t},48.1" for t in range(9)]
    assert any(
        line.startswith("detections: all places are")
        for line in told(PLAIN, posed(), detections=[SEEN[0], *rows]).remarks
    )


def test_trees_are_told_of_and_read_as_the_scenario_says(told):
    trees = ["x,y,dbh", "0,0,0.3", "5,5,0.4", "5,5,0.3"]
    with pytest.raises(InputError, match=re.escape('same place: lines 3, 4; trees.same_place = "merge" makes')):
        told(PLAIN, posed(), trees=trees)
    settings = ["trees.same_place=merge", "trees.canopy_radius=2"]
    found = told(PLAIN, posed(), settings, trees=trees)
    assert [tree.trunk_radius for tree in found.forest.trees] == pytest.approx([0.15, 0.25])
    assert found.forest.trees[0].canopy_radius == 2 and found.setting.trees.same_place == "merge"
    assert any("2 trees of 3 stems" in line for line in found.remarks)
    assert any("column dbh: is taken to be in m" in line for line in found.remarks)
    assert told(PLAIN, posed(), trees=["x_m,y_m"]).forest.trees == ()  # of a mission without trees


def test_a_star_is_a_key_of_all_uavs_of_a_flight(told):
    rows = [[row[0], i, *row[1:]] for row in posed() for i in range(5)]
    cameras = ["uav,fov_deg,pixels", *(f"{i},60,128" for i in range(5))]
    seen = ["time_s,uav,x_m,y_m", *(f"{t},{i},," for t in (0, 1) for i in range(5))]
    found = told("time_s,uav,x_m,y_m,z_m", rows, ["uavs.*.navigation=gnss"], cameras=cameras, detections=seen)
    assert [uav.navigation for uav in found.setting.uavs] == ["gnss"] * 5


@pytest.mark.parametrize(("unit", "doubted"), [(1.0, False), (1 / 0.3048, True)])
def test_heights_in_feet_do_not_fit_to_places_and_pixels(told, unit, doubted):
    slope = 1 / (20 - 0.85)  # of the line of sight to somebody's middle 1 m beside the place below
    focal = 64 / math.tan(math.radians(30))
    rows = [f"{t:.1f},{x},{y},{64 + focal * slope * x},{64 - focal * slope * y}" for t, x, y in ((0, 3, 4), (1, -5, 2))]
    poses = [[0, 0, 0, 20 * unit], [5, 0, 0, 20 * unit]]
    remarks = told(PLAIN, poses, detections=["time_s,x_m,y_m,u_px,v_px", *rows]).remarks
    assert any("are heights in feet?" in remark for remark in remarks) == doubted
