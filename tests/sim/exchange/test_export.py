"""An export is the recording to the last digit, and other tools read it."""

import csv
import dataclasses
import datetime
from importlib import import_module

import numpy as np
import pandas
import pytest
from helpers import synthetic
from helpers.recordings import broken, record
from msgspec import structs
from stonesoup.reader.generic import CSVDetectionReader, CSVGroundTruthReader, CSVTrackReader

from sim.exchange.export import EXPORTS, export
from sim.exchange.scanned_flight import read_flight
from sim.exchange.values import STATE
from sim.facts.columns import TABLES
from sim.facts.flight import Flight
from sim.facts.metrics.score import estimate_velocities
from sim.mission.archive import save
from sim.scenario.environment import Area
from sim.world.recorded_people import read_trajectories
from tracking.errors import InputError

SECONDS = {"time_field": "time", "timestamp": True}
PLAIN = [name for name in EXPORTS if name != "geojson"]  # those of recordings that are nowhere on the map
START = datetime.datetime(1970, 1, 1)


@pytest.fixture(scope="module")
def recording():
    return record(21)


@pytest.fixture(scope="module")
def folders(recording, tmp_path_factory):
    out = tmp_path_factory.mktemp("export")
    for target in PLAIN:
        export(recording, target, out / target)
    return out


def rows(path):
    with path.open(newline="") as file:
        return [[float(text) if text else None for text in row] for row in csv.reader(file) if row[0][0] not in "tux"]


def test_csv_files_hold_scans_trees_and_tracks_bit_for_bit(recording, folders):
    flight = read_flight(folders / "csv")
    for k, scans in enumerate(flight.scans()):
        for i, scan in enumerate(scans):
            np.testing.assert_equal(dataclasses.asdict(scan), dataclasses.asdict(recording.scan_at(k, i)))
    assert flight.frames.all() and flight.forest.trees == recording.forest.trees
    expected = [
        [recording.times[k], i, track.id, *track.belief.mean, *track.belief.covariance[np.triu_indices(4)], np.nan]
        for k in range(21)
        for i in range(3)
        for track in recording.tracks_at(k, i)
    ]
    np.testing.assert_array_equal(rows(folders / "csv" / "tracks.csv"), expected)


def test_the_truth_can_be_flown_again_also_without_people(recording, folders, tmp_path):
    again = read_trajectories(folders / "csv" / "truth.csv", Area(), duration=4.0)
    for k, time in enumerate(recording.times):
        np.testing.assert_allclose(again.at(time)[0], recording.people[k], rtol=0, atol=1e-12)
    truth = [row[2:] for row in rows(folders / "csv" / "truth.csv")]
    np.testing.assert_array_equal(truth, recording.people[~np.isnan(recording.people[..., 0])])
    for target in PLAIN:
        export(record(people=0), target, tmp_path / target)
    assert (tmp_path / "csv" / "truth.csv").read_text() == "time_s,id,x_m,y_m\n"
    assert (tmp_path / "mot" / "uav0" / "det" / "det.txt").read_text() == ""


def test_without_a_frame_or_after_a_breakdown_there_is_no_row(tmp_path):
    setting = synthetic.scenario()
    first, second, third = setting.uavs
    setting = structs.replace(setting, uavs=(first, structs.replace(second, rate=1), third))
    recording = broken(record(21, setting=setting), 2, 7)
    for target in PLAIN:
        export(recording, target, tmp_path / target)
    held = {i: [row[0] for row in rows(tmp_path / "csv" / "detections.csv") if row[1] == i] for i in range(3)}
    assert sorted(set(held[0])) == recording.times.tolist()
    assert sorted(set(held[1])) == recording.times[::5].tolist()
    assert sorted(set(held[2])) == recording.times[:7].tolist()
    assert len(rows(tmp_path / "stonesoup" / "tracks-uav2.csv")) == 7 * 4
    assert len(rows(tmp_path / "mot" / "tracks" / "uav2.txt")) == 7 * 4


def test_only_reported_tracks_go_to_mot_and_all_to_the_others(recording, tmp_path):
    existence = np.where(np.arange(len(recording.track_ids)) % 3 > 0, np.nan, 0.5)
    doubted = dataclasses.replace(recording, track_existence=existence)
    for target in PLAIN:
        export(doubted, target, tmp_path / target)
    found = [row for i in range(3) for row in rows(tmp_path / "mot" / "tracks" / f"uav{i}.txt")]
    told = doubted.track_means[~np.isfinite(existence), :2]
    assert sorted(row[7:9] for row in found) == sorted(told.tolist())
    assert len(rows(tmp_path / "csv" / "tracks.csv")) == len(existence) > len(told)


def test_stone_soup_reads_detections_truth_tracks_and_sensors(recording, folders):
    folder = folders / "stonesoup"
    detections = CSVDetectionReader(str(folder / "detections-uav1.csv"), state_vector_fields=("x", "y"), **SECONDS)
    seen = 0
    for time, found in detections:
        k = round((time - START).total_seconds() * 5)
        ours = recording.scan_at(k, 1)
        assert sorted(map(tuple, ours.measurements)) == sorted(tuple(d.state_vector.ravel()) for d in found)
        assert {float(d.metadata["xx"]) for d in found} == set(ours.covariances[:, 0, 0])
        seen += len(found)
    assert seen == sum(len(recording.scan_at(k, 1).measurements) for k in range(21)) > 0

    path = str(folder / "groundtruth.csv")
    truth = CSVGroundTruthReader(path, state_vector_fields=STATE, path_id_field="id", **SECONDS)
    paths = {path.id: path for _, updated in truth for path in updated}
    states = np.concatenate([recording.people, estimate_velocities(recording)], axis=2)
    for m in range(4):
        there = states[~np.isnan(states[:, m, 0]), m]
        np.testing.assert_array_equal([s.state_vector.ravel() for s in paths[str(m)]], there)

    covariance = {a + b: ([i, j], [j, i]) for i, a in enumerate(STATE) for j, b in enumerate(STATE) if i <= j}
    reader = CSVTrackReader(
        str(folder / "tracks-uav0.csv"),
        state_vector_fields=STATE,
        track_id_field="id",
        default_covar=np.zeros((4, 4)),
        covar_fields_index=covariance,
        **SECONDS,
    )
    tracks = {track.id: track for _, updated in reader for track in updated}
    assert sorted(tracks) == ["1", "2", "3", "4"]
    for k in range(21):
        for track in recording.tracks_at(k, 0):
            np.testing.assert_array_equal(tracks[str(track.id)][k].mean.ravel(), track.belief.mean)
            np.testing.assert_array_equal(np.triu(tracks[str(track.id)][k].covar), np.triu(track.belief.covariance))

    sensors = CSVGroundTruthReader(
        str(folder / "sensors.csv"), state_vector_fields=("x", "y", "z"), path_id_field="uav", **SECONDS
    )
    flights = {path.id: path for _, updated in sensors for path in updated}
    for i in range(3):
        positions = [s.state_vector.ravel() for s in flights[str(i)]]
        np.testing.assert_array_equal(positions, recording.cameras[:, i, :3])


def test_mot_sequences_hold_truth_detections_and_tracks(recording, folders):
    present = ~np.isnan(recording.people[..., 0])
    k, m = np.nonzero(present)
    for i in range(3):
        sequence = folders / "mot" / f"uav{i}"
        truth, found, tracks = (
            np.array(rows(path))
            for path in (sequence / "gt" / "gt.txt", sequence / "det" / "det.txt", folders / f"mot/tracks/uav{i}.txt")
        )
        np.testing.assert_array_equal(truth[:, :2], np.column_stack([k + 1, m + 1]))
        np.testing.assert_array_equal(truth[:, 2:7], np.tile([-1, -1, -1, -1, 1], (len(k), 1)))
        np.testing.assert_array_equal(truth[:, 7:9], recording.people[present])
        scans = [recording.scan_at(k, i).measurements for k in range(21)]
        np.testing.assert_array_equal(found[:, 0], np.repeat(np.arange(1, 22), list(map(len, scans))))
        np.testing.assert_array_equal(found[:, 7:9], np.concatenate(scans))
        expected = [(k + 1, t.id + 1, *t.belief.mean[:2]) for k in range(21) for t in recording.tracks_at(k, i)]
        np.testing.assert_array_equal(tracks[:, [0, 1, 7, 8]], expected)
        assert "\nframeRate=5\nseqLength=21\n" in (sequence / "seqinfo.ini").read_text()


def test_parquet_files_are_the_tables_of_the_flight(recording, folders, monkeypatch, tmp_path):
    flight = Flight(recording)
    assert sorted(path.stem for path in (folders / "parquet").iterdir()) == sorted(TABLES)
    for name in TABLES:
        read = pandas.read_parquet(folders / "parquet" / f"{name}.parquet")
        pandas.testing.assert_frame_equal(read, flight.table(name))
    monkeypatch.setattr("pandas.DataFrame.to_parquet", lambda frame, path: import_module("a_missing_engine"))
    with pytest.raises(InputError, match="parquet: needs pandas with pyarrow, or polars: pip install pyarrow"):
        export(recording, "parquet", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_failed_and_refused_exports_leave_nothing_and_say_why(recording, tmp_path, monkeypatch):
    def write_half(recording, folder):
        (folder / "half").touch()
        raise OSError("disk full")

    monkeypatch.setitem(EXPORTS, "csv", write_half)
    with pytest.raises(OSError, match="disk full"):
        export(recording, "csv", tmp_path / "new")
    with pytest.raises(InputError, match=r"^--to: 'stonesop' is unknown; .*did you mean stonesoup\?$"):
        export(recording, "stonesop", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    with pytest.raises(InputError, match=r"--out: .*full exists and is not an empty folder"):
        export(recording, "csv", tmp_path / "full")


def test_the_command_leaves_a_folder_of_its_own_in_the_run(recording, tmp_path, call):
    (tmp_path / "run").mkdir()
    save(recording, tmp_path / "run" / "mission.npz")
    told = call("export", "run", "--to", "csv")[1]
    assert "cameras.csv, detections.csv, poses.csv, scenario.toml, tracks.csv, trees.csv" in told
    for arguments in (["run/mission.npz", "--to", "csv"], ["run", "--to", "mot", "--out", "m"]):
        assert call("export", *arguments)[0] == 0
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["export-csv", "export-csv-2", "mission.npz"]
    assert sorted(path.name for path in (tmp_path / "m").iterdir()) == ["tracks", "uav0", "uav1", "uav2"]
