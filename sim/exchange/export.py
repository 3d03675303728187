"""A recording in the formats of other tools: scans, tracks and truth as text, without rounding of numbers."""

import csv
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.exchange.flight_tables import CAMERA_COLUMNS, DETECTION_COLUMNS, POSE_COLUMNS, TREE_COLUMNS, TREE_LEAVES
from sim.exchange.ros_layout import make_layout
from sim.exchange.ros_mission import write_bag
from sim.facts.columns import TABLES
from sim.facts.flight import Flight
from sim.facts.metrics.score import estimate_velocities
from sim.mission.atomic_files import make_new_folder
from sim.mission.dataframes import write_parquet
from sim.mission.recording import Recording
from sim.scenario.settings_text import format_toml
from sim.scenario.uavs import Uav
from tracking.errors import check_known
from tracking.numerics.arrays import Flags, Indices

Columns = Mapping[str, NDArray[Any]]  # columns (N,) of a table by name
Rows = Iterable[Sequence[float | int | str]]
STATE = ("x", "y", "vx", "vy")  # m, m/s
# Upper triangle of a covariance by rows; each entry is named by its two states.
COVARIANCE = tuple(a + b for i, a in enumerate(STATE) for b in STATE[i:])
_TRACK = ("time", "uav", "id", *STATE, *COVARIANCE, "existence")
# Endings of columns of `tracks.csv`, which name their units.
_UNITS = {"time": "_s", **dict(zip(STATE, ("_m", "_m", "_m_per_s", "_m_per_s"), strict=True))}
_UNITS |= {name: ("_m2", "_m2_per_s", "_m2_per_s2")[name.count("v")] for name in COVARIANCE}
_MEASUREMENT = ("time", "x", "y", "xx", "xy", "yy")


def export(recording: Recording, target: str, out: Path, *, truth: bool = True) -> None:
    """Write a recording into the new folder `out`, completely or not at all; InputError if target or folder is wrong.

    target: one of `TARGETS`; docs/how-to/tracking.md describes their files. truth: False to leave out what UAVs do not
    know, of a bag.
    """
    check_known("--to", target, TARGETS)
    with make_new_folder(out) as folder:
        if truth:
            TARGETS[target](recording, folder)
        else:
            _write_rosbag(recording, folder, truth=False)


def _write_rosbag(recording: Recording, folder: Path, *, truth: bool = True) -> None:
    """A bag, a layout of Foxglove for it, and what `understory track` needs besides: trees, settings and truth."""
    write_bag(recording, folder / "bag", truth=truth)
    layout = make_layout(recording.uav_count, recording.setting.area.width)
    (folder / "foxglove.json").write_text(layout, encoding="utf-8")
    _write_map_and_settings(recording, folder)
    if truth:
        _write_truth(recording, folder)


def _write_csv(recording: Recording, folder: Path) -> None:
    """The files of a flight, which `understory track` reads; that of the truth also works as `people.trajectories`."""
    times, setting = recording.times.tolist(), recording.setting
    rows = zip(times, recording.believed_cameras.tolist(), strict=True)
    poses = ([time, i, *pose] for time, fleet in rows for i, pose in enumerate(fleet))
    _write_table(folder / "poses.csv", POSE_COLUMNS, poses)
    _write_table(folder / "detections.csv", DETECTION_COLUMNS, _list_detection_rows(recording))
    header = [name + _UNITS.get(name, "") for name in _TRACK]
    _write_table(folder / "tracks.csv", header, sorted(_list_rows(_list_tracks(recording), _TRACK)))
    _write_cameras(setting.uavs, folder)
    _write_truth(recording, folder)
    _write_map_and_settings(recording, folder)


def _write_truth(recording: Recording, folder: Path) -> None:
    """The people, if they are known."""
    if recording.labelled:
        rows = _list_rows(_list_truth(recording), ("time", "person", "x", "y"))
        _write_table(folder / "truth.csv", ("time_s", "id", "x_m", "y_m"), rows)


def _write_map_and_settings(recording: Recording, folder: Path) -> None:
    flown = json.loads(recording.scenario) | {"duration": float(recording.times[-1]) or recording.setting.duration}
    (folder / "scenario.toml").write_text(format_toml(flown), encoding="utf-8")
    trees = [["" if math.isinf(value) else value for value in row] for row in recording.trees.tolist()]
    _write_table(folder / "trees.csv", (*TREE_COLUMNS, TREE_LEAVES)[: recording.trees.shape[1]], trees)


def _write_stonesoup(recording: Recording, folder: Path) -> None:
    """Files for the CSV readers of `stonesoup.reader.generic`: detections and tracks of each UAV separately.

    A reader makes a set of all rows of one time, and Stone Soup's association takes a set as one sensor's scan.
    """
    found, tracks, truth = _list_measurements(recording), _list_tracks(recording), _list_truth(recording)
    own = tuple(name for name in _TRACK if name != "uav")
    for uav in range(recording.uav_count):
        rows = _list_rows(found, _MEASUREMENT, found["uav"] == uav)
        _write_table(folder / f"detections-uav{uav}.csv", _MEASUREMENT, rows)
        _write_table(folder / f"tracks-uav{uav}.csv", own, _list_rows(tracks, own, tracks["uav"] == uav))
    _write_table(folder / "groundtruth.csv", ("time", "id", *STATE), _list_rows(truth, ("time", "person", *STATE)))
    k, i = np.nonzero(recording.frames_taken)
    x, y, z = recording.believed_cameras[k, i, :3].T
    sensors = {"time": recording.times[k], "uav": i, "x": x, "y": y, "z": z}
    _write_table(folder / "sensors.csv", tuple(sensors), _list_rows(sensors, tuple(sensors)))


def _write_mot(recording: Recording, folder: Path) -> None:
    """Files in MOTChallenge's 3-D text format: a sequence for each UAV, boxes -1, positions on the ground in m."""
    scenario = recording.setting
    truth = _list_truth(recording)
    found, tracks = _list_measurements(recording), _list_tracks(recording)
    for uav, camera in enumerate(scenario.uavs):
        sequence = folder / f"uav{uav}"
        _write_table(sequence / "gt" / "gt.txt", (), _list_mot_rows(truth, truth["person"] + 1))
        seen = found["uav"] == uav
        _write_table(sequence / "det" / "det.txt", (), _list_mot_rows(found, np.full(len(seen), -1), seen))
        reported = (tracks["uav"] == uav) & tracks["reported"]
        _write_table(folder / "tracks" / f"uav{uav}.txt", (), _list_mot_rows(tracks, tracks["id"] + 1, reported))
        width, height = camera.true_camera.size
        facts = [f"name=uav{uav}", "imDir=img1", f"frameRate={scenario.rates.sensing}"]
        facts += [f"seqLength={len(recording.times)}", f"imWidth={width}", f"imHeight={height}", "imExt=.png"]
        (sequence / "seqinfo.ini").write_text("\n".join(["[Sequence]", *facts]) + "\n", encoding="utf-8")


def _write_cameras(uavs: Sequence[Uav], folder: Path) -> None:
    """`cameras.csv`, and a file for each calibrated camera, as the fleet believes it to be."""
    rows: list[list[float | int | str]] = []
    for i, uav in enumerate(uavs):
        rows.append([i, uav.fov_deg, uav.pixels, ""])
        if uav.camera:
            o = uav.believed_camera.optics
            calibration = {"focal": [o.fx, o.fy], "centre": [o.cx - 0.5, o.cy - 0.5], "distortion": list(o.distortion)}
            rows[-1][-1] = f"camera{i}.toml"
            text = format_toml({"width": o.width, "height": o.height, **calibration})
            (folder / f"camera{i}.toml").write_text(text, encoding="utf-8")
    columns = [*CAMERA_COLUMNS, *["camera"] * any(uav.camera for uav in uavs)]
    _write_table(folder / "cameras.csv", columns, (row[: len(columns)] for row in rows))


def _write_parquet(recording: Recording, folder: Path) -> None:
    """The tables of `Flight.table`, which name units in their columns."""
    flight = Flight(recording)
    for name in TABLES:
        write_parquet(flight.columns(name), folder / f"{name}.parquet")


TARGETS: dict[str, Callable[[Recording, Path], None]] = {
    "csv": _write_csv,
    "stonesoup": _write_stonesoup,
    "mot": _write_mot,
    "parquet": _write_parquet,
    "rosbag": _write_rosbag,
}


def _list_mot_rows(table: Columns, ids: Indices, where: Flags | None = None) -> Rows:
    """Rows of frame (from 1), id (from 1, or -1), box -1, confidence 1, position on the ground."""
    for k, id_, x, y in _list_rows({**table, "id": ids}, ("scan", "id", "x", "y"), where):
        yield [k + 1, id_, -1, -1, -1, -1, 1, x, y, 0]


def _list_detection_rows(recording: Recording) -> Iterator[Sequence[float | int | str]]:
    """A row for each measurement, and an empty one for each frame without measurements."""
    pixels, offsets = recording.pixels.tolist(), recording.measurement_offsets
    for k, uav in np.argwhere(recording.frames_taken).tolist():
        scan, first = recording.scan_at(k, uav), int(offsets[k * recording.uav_count + uav])
        for n, (z, R) in enumerate(zip(scan.measurements.tolist(), scan.covariances.tolist(), strict=True)):
            pixel = ["" if math.isnan(part) else part for part in pixels[first + n]]
            yield [scan.time, uav, *z, R[0][0], R[0][1], R[1][1], *pixel]
        if len(scan.measurements) == 0:
            yield [scan.time, uav, *[""] * 7]


def _list_measurements(recording: Recording) -> Columns:
    """Position [m] and entries of the covariance [m²] of each measurement."""
    k, uav = recording.cells(recording.measurement_offsets)
    (x, y), R = recording.measurements.T, recording.measurement_covariances
    entries = {"xx": R[:, 0, 0], "xy": R[:, 0, 1], "yy": R[:, 1, 1]}
    return {"scan": k, "uav": uav, "time": recording.times[k], "x": x, "y": y, **entries}


def _list_tracks(recording: Recording) -> Columns:
    """Each track of working UAVs: id, mark of a reported one, state, covariance and existence (NaN if it has none)."""
    k, uav = recording.cells(recording.track_offsets)
    row, column = np.triu_indices(len(STATE))
    columns = {
        "scan": k,
        "uav": uav,
        "time": recording.times[k],
        "reported": recording.reported,
        "id": recording.track_ids,
        **dict(zip(STATE, recording.track_means.T, strict=True)),
        **dict(zip(COVARIANCE, recording.track_covariances[:, row, column].T, strict=True)),
        "existence": recording.track_existence,
    }
    works = recording.working[k, uav]
    return {name: values[works] for name, values in columns.items()}


def _list_truth(recording: Recording) -> Columns:
    """Position [m] and velocity [m/s] of each person present."""
    k, person = np.nonzero(~np.isnan(recording.people[:, :, 0]))
    state = np.hstack([recording.people[k, person], estimate_velocities(recording)[k, person]])
    return {"scan": k, "person": person, "time": recording.times[k], **dict(zip(STATE, state.T, strict=True))}


def _list_rows(table: Columns, names: Sequence[str], where: Flags | None = None) -> Iterator[tuple[Any, ...]]:
    """Rows of the named columns as Python numbers; where (N,): the rows to take, by default all."""
    columns = (table[name] if where is None else table[name][where] for name in names)
    return zip(*(column.tolist() for column in columns), strict=True)


def _write_table(path: Path, header: Sequence[str], rows: Rows) -> None:
    """Write a CSV file, in which floats have as many digits as are needed to read the same values."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerows([header] if header else [])
        table.writerows(rows)
