"""Scans from a CSV: what is read, what is refused, and that the tracker alone repeats a mission from it."""

import math
import re
import sys

import numpy as np
import pytest
from helpers.processes import ROOT, python
from helpers.scenes import scan, tracker
from scipy.stats import chi2

from sim.mission.trial import Trial
from sim.recording.archive import load as load_recording
from sim.replay.export import export
from sim.replay.measurement_tables import (
    CAMERA_COLUMNS,
    SCAN_COLUMNS,
    TREE_COLUMNS,
    read_cameras,
    read_forest,
    read_scans,
)
from sim.running.results import run_mission
from sim.scenario.loading import load
from tracking.filter.mean_reverting import MeanRevertingVelocity
from tracking.fleet import step
from tracking.geometry.camera import ALL_ROUND
from tracking.tracker import Tracker, TrackerParameters

DOCS = (ROOT / "docs" / "how-to" / "tracking.md").read_text(encoding="utf-8")
WALKING = MeanRevertingVelocity(0.2, 0.75, walking_speed=1.75)
HEADER = ",".join(SCAN_COLUMNS)
GATE = chi2.ppf(0.9999, 2)  # of squared errors of a position in its own standard deviations
POSE = "0,0,20,0,0,0,1"
UP = "0,0,20,1,0,0,0"
GOOD = f"0.0,0,1,2,0.1,0,0.1,{POSE}"


def written(tmp_path, *lines, header=HEADER):
    path = tmp_path / "scans.csv"
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def test_rows_become_scans_by_time_and_uav_whatever_their_columns_order(tmp_path):
    path = written(
        tmp_path,
        f"0.5,2,,,,,,{POSE}",
        f"0.5,0,1,2,0.1,0.01,0.2,{POSE}",
        f"0.5,0,3,4,0.3,0,0.3,{POSE}",
        "",
        " 0.7 , 2 ,5,6,0.1,0,0.1,1,2,30,0,0,0.6,0.8",
    )
    (first, third), (alone,) = read_scans(path)
    assert (first.uav, first.time, third.uav, alone.uav, alone.time) == (0, 0.5, 2, 2, 0.7)
    np.testing.assert_array_equal(first.measurements, [[1, 2], [3, 4]])
    np.testing.assert_array_equal(first.covariances, [[[0.1, 0.01], [0.01, 0.2]], [[0.3, 0], [0, 0.3]]])
    assert third.measurements.shape == (0, 2) and third.covariances.shape == (0, 2, 2)
    np.testing.assert_array_equal(alone.pose.position, [1, 2, 30])
    np.testing.assert_array_equal(alone.pose.quaternion, [0, 0, 0.6, 0.8])
    names = [*SCAN_COLUMNS[::-1], "comment"]
    fields = [*GOOD.split(",")[::-1], "whatever"]
    ((found,),) = read_scans(written(tmp_path, ",".join(fields), header="﻿" + ",".join(names)))
    np.testing.assert_array_equal(found.measurements, [[1, 2]])


WRONG = {
    "no number": ([GOOD, f"0.2,0,east,2,0.1,0,0.1,{POSE}"], "line 3, column x: 'east' is not a finite number"),
    "NaN": ([f"0.0,0,1,nan,0.1,0,0.1,{POSE}"], "line 2, column y: 'nan' is not a finite number"),
    "infinite pose": ([GOOD.replace(",20,", ",inf,")], "line 2, column camera_z: 'inf' is not a finite number"),
    "empty time": ([f",0,1,2,0.1,0,0.1,{POSE}"], "line 2, column time: is empty"),
    "half a measurement": ([f"0.0,0,1,,0.1,0,0.1,{POSE}"], "line 2, column y: is empty"),
    "time that goes backwards": (
        [GOOD, f"0.4,0,,,,,,{POSE}", f"0.2,0,,,,,,{POSE}"],
        "line 4, column time: 0.2 s comes after 0.4 s; times must not go backwards",
    ),
    "UAV": ([f"0.0,-1,,,,,,{POSE}"], "line 2, column uav: '-1' is not an integer, 0 or more"),
    "no covariance": (
        [f"0.0,0,1,2,0.1,0.2,0.1,{POSE}"],
        "line 2, column xx: xx, xy, yy of 0.1, 0.2, 0.1 m² are not positive definite",
    ),
    "negative variance": ([f"0.0,0,1,2,-1,0,-1,{POSE}"], "are not positive definite"),
    "no attitude": (["0.0,0,,,,,,0,0,20,0,0,0,0"], "line 2, column camera_qx: the quaternion's norm is 0, not 1"),
    "two poses": ([GOOD, GOOD.replace(",20,", ",21,")], "line 3, column camera_x: the camera has another pose"),
    "measured and not": ([GOOD, f"0.0,0,,,,,,{POSE}"], "line 3, column x: is empty, but this scan has measurements"),
    "not measured and yet": ([f"0.0,0,,,,,,{POSE}", GOOD], "line 3, column x: this scan has another row, without"),
    "a row twice": (
        [GOOD, GOOD.replace("0.0,0", "0.0,1"), GOOD],
        "line 4, column x: the same measurement of this scan",
    ),
    "a row twice, in other words": (
        [GOOD, GOOD.replace("1,2,0.1", "1.0,2e0,.1")],
        "line 3, column x: the same measurement of this scan is in line 2",
    ),
    "an empty row twice": ([f"0.0,0,,,,,,{POSE}"] * 2, "line 3, column x: this scan has another row, without"),
    "1_0": ([GOOD.replace(",1,2,", ",1_0,2,")], "line 2, column x: '1_0' is not a finite number"),
    "full-width digits": (
        [GOOD.replace(",1,2,", ",\uff11\uff10,2,")],
        "line 2, column x: '\uff11\uff10' is not a finite",
    ),
    "a camera that looks up": (
        [f"0.0,0,,,,,,{POSE}", f"0.0,1,1,2,0.1,0,0.1,{UP}", f"0.2,1,,,,,,{UP}"],
        "column camera_qx: the camera of UAV 1 looks above the horizon in each of its 2 scans; "
        "quaternions are xyzw, 0,0,0,1 looks straight down; are these wxyz?",
    ),
    "a heading of 60 degrees as wxyz": (["0.0,0,1,2,0.1,0,0.1,0,0,20,0.8660254,0,0,0.5"], "are these wxyz?"),
    "short row": (["0.0,0,1,2"], "line 2: has 4 entries, not 14 as line 1"),
    "long row": ([GOOD + ",7"], "line 2: has 15 entries, not 14 as line 1"),
    "nothing": ([], "scans.csv: holds no scan"),
}


@pytest.mark.parametrize(("lines", "message"), WRONG.values(), ids=WRONG)
def test_a_row_that_cannot_be_used_is_named(tmp_path, lines, message):
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        list(read_scans(written(tmp_path, *lines)))
    assert str(caught.value).startswith(f"scans: {tmp_path / 'scans.csv'}") and "\n" not in str(caught.value)


def test_a_camera_may_look_up_for_a_while_or_at_somebody_in_front_of_it(tmp_path):
    assert len(list(read_scans(written(tmp_path, GOOD, f"0.2,0,,,,,,{UP}")))) == 2
    # 5 degrees above the horizon to the north, and a person 40 m to the north.
    oblique = f"0,0,3,{math.sin(math.radians(47.5))!r},0,0,{math.cos(math.radians(47.5))!r}"
    ((found,),) = read_scans(written(tmp_path, f"0.0,0,0,40,0.1,0,0.1,{oblique}"))
    assert found.pose.rotation[2, 2] < 0 and len(found.measurements) == 1
    with pytest.raises(ValueError, match="are these wxyz"):
        read_scans(written(tmp_path, f"0.0,0,0,-40,0.1,0,0.1,{oblique}"))


@pytest.mark.parametrize(("times", "gap"), [((0, 200, 400), 200), ((1.7e12, 1.7e12 + 200, 1.7e12 + 400), 200)])
def test_scans_that_are_minutes_apart_are_doubted(tmp_path, times, gap):
    path = tmp_path / "scans.csv"
    path.write_text("\n".join([",".join(SCAN_COLUMNS), *(f"{time:.0f},0,,,,,,0,0,20,0,0,0,1" for time in times)]))
    span = f"3 scans from {times[0]:.0f} to {times[-1]:.0f} s, {gap} s apart"
    with pytest.warns(UserWarning, match=re.escape(f"scans: {path}, column time: {span}; are these milliseconds?")):
        assert len(list(read_scans(path))) == 3


def test_a_column_that_is_missing_or_doubled_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"line 1: column yy is missing; columns are time,uav,x,y,xx,xy,"):
        list(read_scans(written(tmp_path, header=HEADER.replace(",yy", ""))))
    with pytest.raises(ValueError, match="line 1: column time is twice"):
        list(read_scans(written(tmp_path, header=HEADER + ",time")))
    (tmp_path / "empty.csv").touch()
    with pytest.raises(ValueError, match="is empty; its first line must name the columns time,uav,x,y"):
        list(read_scans(tmp_path / "empty.csv"))


TABLES = {
    "trees": (read_forest, TREE_COLUMNS),
    "cameras": (read_cameras, CAMERA_COLUMNS),
    "scans": (read_scans, SCAN_COLUMNS),
}


@pytest.mark.parametrize(
    ("table", "row", "complaint"),
    [
        ("trees", b"0,0,-1,3,6,0.2", "line 2, column canopy_radius: -1 m is not allowed"),
        ("trees", b"0,0,1,3,6,-0.2", "line 2, column trunk_radius: -0.2 m is not allowed"),
        ("trees", b"0,0,1,7,6,0.2", "line 2, column canopy_base: the crown begins at 7 m"),
        ("trees", b"0,0,1,3,6," + b"1" * 200_000, "line 2: field larger than field limit"),
        (
            "trees",
            b"0,0,1,3,6,0.2\n1,0,1,3,6,0.2\n0,0,1,3,6.0,0.2",
            "line 4, column x: the stem of line 2 stands at the same place",
        ),
        ("trees", b"0,0,1,3,6,\xe9", "line 2, column trunk_radius: 'é' is not a finite number"),
        ("cameras", b"0,1," + b"1" * 5000, "line 2, column pixels: an integer of 5000 digits"),
        ("scans", b"0," + b"1" * 5000 + b",,,,,,0,0,20,0,0,0,1", "line 2, column uav: an integer of"),
    ],
)
def test_a_wrong_row_of_a_table_is_named_in_one_line(tmp_path, table, row, complaint):
    path, (read, columns) = tmp_path / "table.csv", TABLES[table]
    path.write_bytes(",".join(columns).encode() + b"\n" + row + b"\n")
    with pytest.raises(ValueError, match=rf"table\.csv, {complaint}") as raised:
        list(getattr(found := read(path), "trees", found))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0,4,128", "column fov: 4 is not allowed; expected more than 0 and less than pi rad, or 2 pi: all round"),
        ("0,1,0", "column pixels: 0 is not allowed"),
        ("0,1,64.5", "column pixels: '64.5' is not an integer"),
        ("1,1,128", "column uav: UAV 1 has a second row"),
    ],
)
def test_a_camera_that_cannot_be_is_named(tmp_path, line, message):
    with pytest.raises(ValueError, match=re.escape(f"line 3, {message}")):
        read_cameras(written(tmp_path, "1,1.0,128", line, header="uav,fov,pixels"))


def test_a_camera_that_sees_all_round_is_read(tmp_path):
    lines = f"1,{2 * math.pi!r},128", "2,6.2831853,128"
    read = read_cameras(written(tmp_path, *lines, header="uav,fov,pixels"))
    assert read[1].fov == read[2].fov == ALL_ROUND


def test_the_tracker_alone_repeats_the_tracks_of_the_mission(mission):
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
    recording, out = mission
    forest, parameters = read_forest(out / "csv" / "trees.csv"), TrackerParameters(WALKING)
    cameras = read_cameras(out / "csv" / "cameras.csv")
    fleet = [Tracker(uav, camera, forest, parameters) for uav, camera in cameras.items()]
    held = 0
    for k, scans in enumerate(read_scans(out / "csv" / "scans.csv")):
        step(fleet, scans)
        for i, alone in enumerate(fleet):
            expected = recording.tracks_at(k, i)
            assert [track.id for track in alone.tracks] == [track.id for track in expected]
            for track, recorded in zip(alone.tracks, expected, strict=True):
                np.testing.assert_allclose(track.belief.mean, recorded.belief.mean, rtol=1e-12)
                np.testing.assert_allclose(track.belief.covariance, recorded.belief.covariance, rtol=1e-9, atol=1e-12)
            held += len(expected)
    assert k == 40 and held > 200


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    """A flown mission that began without tracks, and its exports."""
    out = tmp_path_factory.mktemp("mission")
    setting = load("forest", ["duration=8", "sensing.mode=ideal", "tracking.initial_tracks=none"])
    run_mission(Trial(setting, "greedy", 0), out / "run", video=False)
    recording = load_recording(out / "run" / "mission.npz")
    export(recording, "csv", out / "csv")
    export(recording, "stonesoup", out / "stonesoup")
    return recording, out


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", DOCS, flags=re.M | re.S)


def test_the_documented_lines_track_without_engine_and_planners(mission):
    recording, out = mission
    ((block,)) = [block for block in blocks("python") if "read_scans" in block]
    assert len([line for line in block.splitlines() if line]) <= 10
    check = "\nimport sys\nassert not {'pybullet', 'planning', 'cv2'} & set(sys.modules), sorted(sys.modules)\n"
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
