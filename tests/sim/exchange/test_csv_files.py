"""Flights as CSV files: what is read, what is refused, and that the tracker alone repeats a mission from them."""

import math
import re
import sys

import numpy as np
import pytest
from helpers.processes import ROOT, python
from helpers.scenes import scan, tracker
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from sim.exchange.csv_files import (
    CAMERA_COLUMNS,
    DETECTION_COLUMNS,
    POSE_COLUMNS,
    read_cameras,
    read_detections,
    read_poses,
)
from sim.exchange.export import export
from sim.mission.archive import load_recording
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from tracking.errors import InputError
from tracking.fusion.consensus import step
from tracking.geometry.quaternions import rotation

DOCS = (ROOT / "docs" / "how-to" / "tracking.md").read_text(encoding="utf-8")
GATE = chi2.ppf(0.9999, 2)  # of squared errors of a position in its own standard deviations


def written(tmp_path, *lines, header):
    path = tmp_path / "table.csv"
    path.write_text("\n".join([",".join(header), *lines]) + "\n")
    return path


def test_rows_of_detections_become_frames_by_uav_and_time_in_any_order(tmp_path):
    lines = ["0.7,2,,,,,,,", "0.5,0,1,2,0.1,0.01,0.2,64,32", "0.5,2,,,,,,7,8", "0.5,0,3,4,,,,,", ""]
    found = read_detections(written(tmp_path, *lines, header=DETECTION_COLUMNS))
    assert {uav: [frame.time for frame in seen.frames] for uav, seen in found.items()} == {0: [0.5], 2: [0.5, 0.7]}
    first, second = found[0].frames[0].detections
    assert (first.place, first.covariance, first.pixel) == ((1, 2), (0.1, 0.01, 0.2), (64, 32))
    assert second.place == (3, 4) and np.isnan([*second.covariance, *second.pixel]).all()
    (imaged,) = found[2].frames[0].detections
    assert imaged.pixel == (7, 8) and np.isnan(imaged.place).all() and found[2].frames[1].detections == []


def test_one_uav_needs_no_number_and_a_column_without_use_is_ignored(tmp_path):
    found = read_detections(written(tmp_path, "0.5,a,1,2", header=("time_s", "comment", "x_m", "y_m")))
    assert [frame.detections[0].place for frame in found[0].frames] == [(1, 2)]
    poses = read_poses(written(tmp_path, "0.2,1,2,30", "0.1,0,0,29", header=("time_s", "x_m", "y_m", "z_m")))
    np.testing.assert_array_equal(poses[0].times, [0.1, 0.2])
    np.testing.assert_array_equal(poses[0].rows, [[0, 0, 29, 0, 0, 0, 1], [1, 2, 30, 0, 0, 0, 1]])


@pytest.mark.parametrize("angles", [(0, -90, 0), (90, -90, 0), (0, 0, 0), (-120, -70, 15), (200, -20, -40)])
def test_angles_of_a_gimbal_give_the_attitude_of_its_camera(tmp_path, angles):
    header = ("time_s", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "roll_deg")
    poses = read_poses(written(tmp_path, f"0,0,0,20,{','.join(map(str, angles))}", header=header))
    right, top, back = rotation(poses[0].rows[0, 3:]).T
    yaw, pitch, roll = np.radians(angles)
    ahead = np.array([math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), math.sin(pitch)])
    np.testing.assert_allclose(-back, ahead, atol=1e-12)
    level = Rotation.from_rotvec(roll * ahead).apply([math.cos(yaw), -math.sin(yaw), 0.0])
    np.testing.assert_allclose(right, level, atol=1e-12)
    np.testing.assert_allclose(np.cross(right, top), back, atol=1e-12)


def test_a_rounded_quaternion_is_normalised_and_an_exact_one_stays(tmp_path):
    exact = [0.1, 0.2, 0.3, math.sqrt(0.86)]
    lines = [f"0,0,0,0,20,{','.join(map(repr, exact))}", "1,0,0,0,20,0.1,0.2,0.3,0.927"]
    rows = read_poses(written(tmp_path, *lines, header=POSE_COLUMNS))[0].rows
    assert rows[0, 3:].tolist() == exact and abs(np.linalg.norm(rows[1, 3:]) - 1) < 1e-15


SEEN, FLOWN, TAKEN = (",".join(columns) for columns in (DETECTION_COLUMNS, POSE_COLUMNS, CAMERA_COLUMNS))
# Reader, lines of a file, and what is said of them.
WRONG = {
    "NaN": (read_detections, [SEEN, "0.2,0,1,nan,,,,,"], "line 2, column y_m: 'nan' is not a finite number"),
    "no covariance": (
        *(read_detections, [SEEN, "0,0,1,2,0.1,0.2,0.1,,"]),
        "line 2, column xx_m2: xx_m2, xy_m2, yy_m2 of 0.1, 0.2, 0.1 are not positive definite",
    ),
    "no place": (read_detections, ["time_s,x,y", "1,1,1"], "line 1: names neither x_m and y_m nor u_px and v_px"),
    "twice": (read_detections, [SEEN, "0,0,1,2,,,,,", "0,0,1.0,2e0,,,,,"], "line 3, column time_s: the same detection"),
    "no frame": (read_detections, [SEEN], "holds no frame"),
    "no attitude": (read_poses, [FLOWN, "0,0,0,0,20,0,0,0,0"], "line 2, column qx: the quaternion's norm is 0, not 1"),
    "two cameras": (read_cameras, [TAKEN, "1,60,128", "1,60,128"], "line 3, column uav: UAV 1 has a second row"),
}


@pytest.mark.parametrize(("read", "lines", "complaint"), WRONG.values(), ids=WRONG)
def test_a_wrong_table_is_refused_in_one_line(tmp_path, read, lines, complaint):
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read(written(tmp_path, *lines[1:], header=lines[0].split(",")))
    assert "\n" not in str(told.value)


def test_a_fleet_steps_only_with_scans_of_one_time_and_of_its_own_uavs():
    one, two = tracker(), tracker(uav=1)
    for k in range(4):
        step([one, two], [scan(k, (0.0, 0.0))])
    assert [t.id for t in one.tracks] == [t.id for t in two.tracks] and len(one.tracks) == 1
    step([one, two], [scan(4, (0.0, 0.0))], np.zeros((2, 2), dtype=bool))
    with pytest.raises(ValueError, match=r"scans of UAVs \[7\], of which the fleet has no tracker"):
        step([one, two], [scan(5, uav=7)])
    with pytest.raises(ValueError, match="of one time and of different UAVs"):
        step([one, two], [scan(5), scan(6, uav=1)])
    with pytest.raises(ValueError, match="of one time and of different UAVs"):
        step([one, two], [])


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    """A flown mission that began without tracks, and its exports."""
    out = tmp_path_factory.mktemp("mission")
    setting = load_scenario("forest", ["duration=8", "sensing.mode=ideal", "tracking.initial_tracks=none"])
    run_mission(Trial(setting, "greedy", 0), out / "run", video=False)
    recording = load_recording(out / "run" / "mission.npz")
    export(recording, "csv", out / "csv")
    export(recording, "stonesoup", out / "stonesoup")
    return recording, out


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", DOCS, flags=re.M | re.S)


def test_the_documented_lines_track_without_the_engine(mission):
    recording, out = mission
    ((block,)) = [block for block in blocks("python") if "read_flight" in block]
    assert len([line for line in block.splitlines() if line]) <= 10
    check = "\nimport sys\nassert 'pybullet' not in sys.modules\n"
    done = python("-c", block + check, cwd=out / "csv")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 41
    expected = {track.id: track.belief.mean.round(2).tolist() for track in recording.tracks_at(40, 0)}
    assert expected and lines[-1] == f"8.0 {expected}"


def test_the_documented_lines_track_a_person_with_stone_soup(mission, monkeypatch):
    recording, out = mission
    ((block,)) = [block for block in blocks("python") if "stonesoup" in block]
    monkeypatch.chdir(out / "stonesoup")
    names = {}
    exec(compile(block, "docs/how-to/tracking.md", "exec"), names)
    track, seen = names["track"], 0
    for state in track[1:]:
        k = round((state.timestamp - track[0].timestamp).total_seconds() * 5)
        if recording.matched[k, 1, 1]:
            seen += 1
            error = np.asarray(state.state_vector[[0, 2], 0], dtype=float) - recording.people[k, 1]
            assert error @ np.linalg.solve(state.covar[np.ix_([0, 2], [0, 2])].astype(float), error) < GATE
    assert seen > 15


def test_the_documented_commands_are_valid(mission, monkeypatch, tmp_path):
    from sim import __main__ as cli

    _, out = mission
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "forest-sma-nbo-gospa-seed0").symlink_to(out / "run")
    (block,) = blocks("sh")
    for line in block.splitlines():
        monkeypatch.setattr(sys, "argv", line.split())
        cli.main()
    assert {path.name for path in (out / "run").iterdir()} >= {"export-csv", "export-stonesoup"}
    assert (tmp_path / "mot" / "uav0" / "gt" / "gt.txt").is_file()
