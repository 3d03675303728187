"""The recording gives back exactly what it was given, and refuses what is none."""

import csv
import dataclasses
import hashlib
import math
import os
from dataclasses import fields

import numpy as np
import pytest
from helpers import synthetic
from helpers.flights import fly, recording_of
from helpers.recordings import assert_same, npy, record, rewritten

from planning.planner import Plan
from sim.exchange.export import export
from sim.mission.archive import compute_digest, load_recording, save
from sim.mission.recorder import Recorder
from sim.mission.recording import OPTIONAL, Recording
from sim.scenario.environment import Trees
from sim.world.stem_map import read_stem_map
from tracking.geometry.visibility import Forest
from tracking.track import Scan


@pytest.mark.parametrize("options", [{}, {"people": 0}, {"uavs": 1}, {"mode": "ideal"}, {"scans": 1}])
def test_a_recording_survives_the_disk_bit_for_bit(tmp_path, options):
    recording = record(**options)
    save(recording, tmp_path / "mission.npz")
    assert_same(load_recording(tmp_path / "mission.npz"), recording)
    assert os.listdir(tmp_path) == ["mission.npz"]
    turned = {"people": npy(np.asfortranarray(recording.people))}  # Fortran's order of axes
    assert_same(load_recording(rewritten(tmp_path / "mission.npz", tmp_path / "turned.npz", **turned)), recording)


def test_leaves_of_porous_trees_survive_the_disk_and_an_export(tmp_path):
    recording = record()
    assert recording.trees.shape[1] == 6
    porous = np.column_stack([recording.trees, np.where(np.arange(len(recording.trees)) % 2, math.inf, 0.4)])
    recording = dataclasses.replace(recording, trees=porous)
    save(recording, tmp_path / "mission.npz")
    found = load_recording(tmp_path / "mission.npz")
    assert_same(found, recording)
    assert np.array_equal(found.forest.table, porous)
    export(found, "csv", tmp_path / "tables")
    assert read_stem_map(tmp_path / "tables" / "trees.csv", "trees", Trees()).trees == found.forest.trees
    for wrong in (np.nan, -0.1):
        save(dataclasses.replace(recording, trees=np.where(porous == 0.4, wrong, porous)), tmp_path / "wrong.npz")
        with pytest.raises(ValueError, match="have a leaf area density below 0 or none"):
            load_recording(tmp_path / "wrong.npz")


def test_large_recordings_are_compressed_and_hashed_as_if_they_were_not(tmp_path, monkeypatch):
    recording = record(uavs=6, people=20)
    save(recording, tmp_path / "plain.npz")
    plain = (tmp_path / "plain.npz").read_bytes()
    assert compute_digest(recording) == hashlib.sha256(plain).hexdigest()
    monkeypatch.setattr("sim.mission.archive._LARGE", len(plain) - 1)
    save(recording, tmp_path / "small.npz")
    assert (tmp_path / "small.npz").stat().st_size < len(plain) / 2
    assert_same(load_recording(tmp_path / "small.npz"), recording)
    assert compute_digest(recording) == hashlib.sha256(plain).hexdigest()


def test_snapshots_and_accessors_give_back_what_was_recorded():
    recording = record()
    recorder = Recorder()
    for k in range(len(recording.times)):
        recorder.add(recording.snapshot(k))
    again = recorder.recording(scenario=recording.scenario, planner="hover", seed=2**70, forest=recording.forest)
    assert_same(again, recording)
    setting = synthetic.scenario()
    given = list(synthetic.snapshots(setting, synthetic.forest(setting), 11))
    assert sum(len(scan.measurements) for snapshot in given for scan in snapshot.scans) > 20
    for k, snapshot in enumerate(given):
        np.testing.assert_equal(dataclasses.asdict(recording.snapshot(k)), dataclasses.asdict(snapshot))


def test_a_mission_yields_the_rows_that_its_recording_gives():
    mission, snapshots = fly("network.plan_delay=1.4", "uavs.1.fails_at=1.5", seed=1, duration=3, planner="greedy")
    recording = recording_of(mission, snapshots, seed=1)
    assert [row.flown.made if row.flown else None for row in snapshots[::4]] == [None, None, 0.0, 1.0]
    for k, row in enumerate(snapshots):
        shown = recording.snapshot(k)
        np.testing.assert_array_equal(shown.known_ospa, row.ospa)
        np.testing.assert_equal(
            dataclasses.asdict(dataclasses.replace(shown, known_ospa=None)), dataclasses.asdict(row)
        )


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


def test_a_recorder_keeps_values_and_refuses_nothing_and_unmatched_detections():
    setting = synthetic.scenario()
    snapshot = next(synthetic.snapshots(setting, Forest(()), 1))
    recorder = Recorder()
    recorder.add(snapshot)
    before = snapshot.people.copy()
    snapshot.people[:] = -1.0
    recording = recorder.recording(scenario="{}", planner="p", seed=0, forest=Forest(()))
    np.testing.assert_array_equal(recording.people[0], before)
    recorder = Recorder()
    assert len(recorder) == 0
    with pytest.raises(ValueError, match="no scan"):
        recorder.recording(scenario="{}", planner="p", seed=0, forest=Forest(()))
    snapshot = next(synthetic.snapshots(synthetic.scenario(uavs=1), Forest(()), 1))
    scan = Scan(0, 0.0, snapshot.cameras[0], np.zeros((2, 2)), np.zeros((2, 2, 2)))
    with pytest.raises(ValueError, match="2 measurements of 1 detections"):
        recorder.add(dataclasses.replace(snapshot, scans=[scan], pixels=[np.zeros((1, 2))]))
    assert len(recorder) == 0


def test_a_recording_that_cannot_be_written_leaves_the_file_before(tmp_path):
    path = tmp_path / "mission.npz"
    recording = record(scans=1)
    save(recording, path)
    before = path.read_bytes()
    broken = dataclasses.replace(recording, people=np.array(["not", "a", "number"]))
    with pytest.raises(ValueError):
        save(broken, path)
    assert path.read_bytes() == before and os.listdir(tmp_path) == ["mission.npz"]


def test_truncated_and_flipped_bytes_never_pass_or_crash(saved, tmp_path):
    content = saved.read_bytes()
    original = load_recording(saved)
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
            recording = load_recording(path)
        except ValueError as error:
            assert str(path) in str(error)
        else:
            assert_same(recording, original)  # the flip hit a byte that carries nothing


@pytest.mark.parametrize("name", [f.name for f in fields(Recording) if f.name not in ("version", *OPTIONAL)])
def test_a_recording_of_another_version_is_one_line(saved, tmp_path, refused, name):
    """Nothing stands in for an array that the file lacks."""
    old = rewritten(saved, tmp_path / "mission.npz", **{name: None})
    told = refused("explain", str(old))
    assert told == f"understory: DIR: {old}: made by another version of understory: it has no field '{name}'\n"


def managed(management: str):
    """A recording, and the tracks that the mission had."""
    flown = fly("sensing.mode=ideal", "trees.density=0", f"tracking.management={management}", seed=1, duration=2)
    return recording_of(*flown, seed=1), [track for s in flown[1] for held in s.tracks for track in held]


def exported(recording, folder) -> list[float]:
    export(recording, "csv", folder)
    with (folder / "tracks.csv").open(newline="") as file:
        return [float(row["existence"]) for row in csv.DictReader(file)]


def test_sightings_and_existence_come_back_to_the_last_bit_where_they_are_known(tmp_path):
    recording, given = managed("existence")
    existence = [track.existence for track in given]
    assert all(0.0 < r < 1.0 for r in existence) and len(set(existence)) > 5
    assert len({track.sighting[2] for track in given}) > 1
    save(recording, tmp_path / "mission.npz")
    again = load_recording(tmp_path / "mission.npz")
    found = [track for k in range(11) for i in range(3) for track in again.tracks_at(k, i)]
    assert [track.existence for track in found] == exported(again, tmp_path / "csv") == existence
    np.testing.assert_array_equal([track.sighting for track in found], [track.sighting for track in given])
    counted, given = managed("m_of_n")
    assert {track.existence for track in given} == {1.0} and np.all(np.isnan(counted.track_existence))
    assert {track.existence for track in counted.tracks_at(10, 0)} == {1.0}
    assert all(math.isnan(r) for r in exported(counted, tmp_path / "counted"))
