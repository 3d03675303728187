"""The recording gives back exactly what it was given, and refuses what is not a recording."""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import synthetic
from helpers.recordings import assert_same, npy, record, rewritten

from planning.planner import Plan
from sim.recording.archive import load, save
from sim.recording.recording import Recorder
from tracking.geometry.visibility import Forest
from tracking.tracker import Scan

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "mission.npz"
    save(record(), path)
    return path


@pytest.mark.parametrize("options", [{}, {"people": 0}, {"uavs": 1}, {"mode": "ideal"}, {"scans": 1}])
def test_a_recording_survives_the_disk_bit_for_bit(tmp_path, options):
    recording = record(**options)
    save(recording, tmp_path / "mission.npz")
    assert_same(load(tmp_path / "mission.npz"), recording)
    assert os.listdir(tmp_path) == ["mission.npz"]


def test_snapshots_of_a_recording_record_to_the_same_recording():
    recording = record()
    recorder = Recorder()
    for k in range(len(recording.times)):
        recorder.add(recording.snapshot(k))
    again = recorder.recording(scenario=recording.scenario, planner="hover", seed=2**70, forest=recording.forest)
    assert_same(again, recording)


def test_accessors_give_back_each_uavs_own_rows():
    setting = synthetic.scenario()
    trees = synthetic.forest(setting)
    given = list(synthetic.snapshots(setting, trees, 11))
    recording = record()
    assert sum(len(scan.measurements) for snapshot in given for scan in snapshot.scans) > 20
    for k, snapshot in enumerate(given):
        for i in range(3):
            np.testing.assert_array_equal(recording.measurements_at(k, i), snapshot.scans[i].measurements)
            np.testing.assert_array_equal(recording.pixels_at(k, i), snapshot.pixels[i])
            scan, held = recording.scan_at(k, i), recording.tracks_at(k, i)
            assert (scan.uav, scan.time) == (i, snapshot.time)
            np.testing.assert_array_equal(scan.covariances, snapshot.scans[i].covariances)
            np.testing.assert_array_equal(scan.pose.position, snapshot.cameras[i].position)
            assert [track.id for track in held] == [track.id for track in snapshot.tracks[i]]
            for track, expected in zip(held, snapshot.tracks[i], strict=True):
                np.testing.assert_array_equal(track.belief.mean, expected.belief.mean)
                np.testing.assert_array_equal(track.belief.covariance, expected.belief.covariance)


def test_plans_of_different_horizons_come_back_at_the_scans_that_made_them():
    setting = synthetic.scenario(uavs=2)
    recorder = Recorder()
    made = [Plan(np.array([[1.0, 2.0]])), Plan(np.arange(6.0).reshape(3, 2))]
    for snapshot in synthetic.snapshots(setting, Forest(()), 6):
        recorder.add(dataclasses.replace(snapshot, plans=made if snapshot.time == 0.4 else None))
    recording = recorder.recording(scenario="{}", planner="p", seed=0, forest=Forest(()))
    assert recording.plans.shape == (1, 2, 3, 2)
    assert [recording.plans_at(k) is None for k in range(6)] == [True, True, False, True, True, True]
    for plan, expected in zip(recording.plans_at(2), made, strict=True):
        np.testing.assert_array_equal(plan.controls, expected.controls)


def test_a_recorder_keeps_values_that_the_mission_overwrites_later():
    setting = synthetic.scenario()
    snapshot = next(synthetic.snapshots(setting, Forest(()), 1))
    recorder = Recorder()
    recorder.add(snapshot)
    before = snapshot.people.copy()
    snapshot.people[:] = -1.0
    recording = recorder.recording(scenario="{}", planner="p", seed=0, forest=Forest(()))
    np.testing.assert_array_equal(recording.people[0], before)


def test_a_recorder_refuses_an_empty_mission_and_unmatched_detections():
    recorder = Recorder()
    assert len(recorder) == 0
    with pytest.raises(ValueError, match="no scan"):
        recorder.recording(scenario="{}", planner="p", seed=0, forest=Forest(()))
    snapshot = next(synthetic.snapshots(synthetic.scenario(uavs=1), Forest(()), 1))
    scan = Scan(0, 0.0, snapshot.cameras[0], np.zeros((2, 2)), np.zeros((2, 2, 2)))
    with pytest.raises(ValueError, match="2 measurements of 1 detections"):
        recorder.add(dataclasses.replace(snapshot, scans=[scan], pixels=[np.zeros((1, 2))]))
    assert len(recorder) == 0


def test_equal_missions_are_equal_bytes_in_two_processes(tmp_path):
    code = (
        "import sys; sys.path[:0] = sys.argv[2:]; from helpers.recordings import record; "
        "from sim.recording.archive import save; save(record(), sys.argv[1])"
    )
    for name, zone in (("a.npz", "UTC"), ("b.npz", "Asia/Tokyo")):
        command = [sys.executable, "-c", code, str(tmp_path / name), str(ROOT), str(ROOT / "tests")]
        hashed = {**os.environ, "TZ": zone, "PYTHONHASHSEED": str(len(zone))}
        subprocess.run(command, check=True, env=hashed, cwd=tmp_path)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    save(record(seed=1), tmp_path / "c.npz")
    assert (tmp_path / "a.npz").read_bytes() != (tmp_path / "c.npz").read_bytes()


def test_a_default_mission_takes_less_than_two_megabytes(tmp_path):
    save(record(scans=201), tmp_path / "mission.npz")
    assert (tmp_path / "mission.npz").stat().st_size < 2e6


def test_numpy_reads_a_recording_without_pickles(saved):
    with np.load(saved, allow_pickle=False) as archive:
        assert archive["people"].shape == (11, 4, 2)
        assert int(str(archive["seed"])) == 2**70


def test_a_failed_save_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "mission.npz"
    recording = record(scans=1)
    save(recording, path)
    before = path.read_bytes()
    broken = dataclasses.replace(recording, people=np.array(["not", "a", "number"]))
    with pytest.raises(ValueError):
        save(broken, path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["mission.npz"]


@pytest.mark.parametrize(
    ("changes", "field", "reason"),
    [
        ({"people": None}, "people", "missing"),
        ({"version": npy(np.int64(2))}, "version", "is 2, but this program reads 1"),
        ({"people": npy(np.zeros((11, 4, 3)))}, "people", "shape"),
        ({"people": npy(np.zeros((11, 4)))}, "people", "shape"),
        ({"headings": npy(np.zeros((10, 4)))}, "headings", "shape"),
        ({"headings": npy(np.zeros((11, 4), np.float32))}, "headings", "dtype"),
        ({"planner": npy(np.array(3))}, "planner", "dtype"),
        ({"seed": npy(np.array("seven"))}, "seed", "seven"),
        ({"commands": npy(np.array([[print]], dtype=object))}, "commands", "Object arrays"),
        ({"commands": b"junk"}, "commands", "cannot be read"),
        ({"track_offsets": npy(np.zeros(34, np.int64))}, "track_offsets", "does not rise"),
        ({"measurement_offsets": npy(np.zeros(3, np.int64))}, "measurement_offsets", "shape"),
    ],
)
def test_a_damaged_field_is_one_clear_line_with_file_and_field(saved, tmp_path, changes, field, reason):
    path = rewritten(saved, tmp_path / "damaged.npz", **changes)
    with pytest.raises(ValueError, match=reason) as caught:
        load(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and f"'{field}'" in message and "\n" not in message


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"\x80\x04N.", b"\x93NUMPY" + bytes(100)])
def test_what_is_no_zip_archive_is_no_recording(tmp_path, content):
    path = tmp_path / "mission.npz"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"mission\.npz: not a recording"):
        load(path)


def test_truncated_and_flipped_bytes_never_pass_or_crash(saved, tmp_path):
    content = saved.read_bytes()
    original = load(saved)
    rng = np.random.default_rng(0)
    path = tmp_path / "damaged.npz"
    for trial in range(300):
        damaged = bytearray(content[: rng.integers(len(content))] if trial % 10 == 0 else content)
        if trial % 10:
            # Half of the flips hit the directory at the end, where the parser is most exposed.
            start = len(content) - 3000 if trial % 2 else 0
            damaged[rng.integers(start, len(content))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            recording = load(path)
        except ValueError as error:
            assert str(path) in str(error)
        else:
            assert_same(recording, original)  # the flip hit a byte that carries nothing
