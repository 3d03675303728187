"""A recording in the formats of other tools: scans, tracks and truth as text, without rounding of numbers."""

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.evaluation.score import velocities
from sim.recording.atomic_files import new_folder
from sim.recording.recording import Recording
from sim.replay.frames.rerender import frames_taken
from sim.replay.measurement_tables import CAMERA_COLUMNS, SCAN_COLUMNS, TREE_COLUMNS
from sim.sensing.cameras import view_of
from sim.world.trajectories import COLUMNS as PEOPLE_COLUMNS
from tracking.errors import check_known
from tracking.numerics.arrays import Array, Flags, Indices

Row = Sequence[float | int | str]
Rows = Iterable[tuple[Any, ...]]
STATE = ("x", "y", "vx", "vy")  # m, m/s
# Upper triangle of a covariance by rows; each entry is named by its two states.
COVARIANCE = tuple(a + b for i, a in enumerate(STATE) for b in STATE[i:])
_TRACK = ("id", *STATE, *COVARIANCE, "existence")


def export(recording: Recording, target: str, out: Path) -> None:
    """Write a recording into the new folder `out`, completely or not at all; InputError if target or folder is wrong.

    target: `csv`, `stonesoup` or `mot`; docs/how-to/tracking.md describes files and columns.
    """
    check_known("--to", target, TARGETS)
    with new_folder(out) as folder:
        TARGETS[target](recording, folder)


def _csv(recording: Recording, folder: Path) -> None:
    """Tables for `sim.replay.measurement_tables`; that of the truth also works as `people.trajectories`."""
    _table(folder / "scans.csv", SCAN_COLUMNS, _scan_rows(recording))
    tracks = sorted([time, uav, *row] for _, uav, time, _, *row in _tracks(recording))
    _table(folder / "tracks.csv", ("time", "uav", *_TRACK), tracks)
    _table(folder / "truth.csv", PEOPLE_COLUMNS, ([time, m, x, y] for _, m, time, x, y, *_ in _truth(recording)))
    cameras = [view_of(uav, recording.setting) for uav in recording.setting.uavs]
    _table(folder / "cameras.csv", CAMERA_COLUMNS, ([i, camera.fov, camera.pixels] for i, camera in enumerate(cameras)))
    _table(folder / "trees.csv", TREE_COLUMNS, recording.trees.tolist())


def _stonesoup(recording: Recording, folder: Path) -> None:
    """Files for the CSV readers of `stonesoup.reader.generic`: detections and tracks of each UAV separately.

    A reader makes a set of all rows of one time, and Stone Soup's association takes a set as one sensor's scan.
    """
    found, tracks = list(_measurements(recording)), list(_tracks(recording))
    for uav in range(recording.poses.shape[1]):
        own = ([time, *row] for _, i, time, *row in found if i == uav)
        _table(folder / f"detections-uav{uav}.csv", ("time", "x", "y", "xx", "xy", "yy"), own)
        own = ([time, *row] for _, i, time, _, *row in tracks if i == uav)
        _table(folder / f"tracks-uav{uav}.csv", ("time", *_TRACK), own)
    truth = ([time, m, *state] for _, m, time, *state in _truth(recording))
    _table(folder / "groundtruth.csv", ("time", "id", *STATE), truth)
    k, i = np.nonzero(frames_taken(recording))
    looks = ([time, uav, *place] for _, uav, time, *place in _rows(recording, (k, i), *recording.cameras[k, i, :3].T))
    _table(folder / "sensors.csv", ("time", "uav", "x", "y", "z"), looks)


def _mot(recording: Recording, folder: Path) -> None:
    """Files in MOTChallenge's 3-D text format: a sequence for each UAV, boxes -1, positions on the ground in m."""
    scenario, found, tracks = recording.setting, list(_measurements(recording)), list(_tracks(recording))
    truth = [_mot_row(k, m + 1, xy) for k, m, _, *xy, _, _ in _truth(recording)]
    for uav in range(recording.poses.shape[1]):
        sequence = folder / f"uav{uav}"
        _table(sequence / "gt" / "gt.txt", (), truth)
        own = (_mot_row(k, -1, row[:2]) for k, i, _, *row in found if i == uav)
        _table(sequence / "det" / "det.txt", (), own)
        own = (_mot_row(k, id_ + 1, row[:2]) for k, i, _, reported, id_, *row in tracks if i == uav and reported)
        _table(folder / "tracks" / f"uav{uav}.txt", (), own)
        pixels = scenario.uavs[uav].pixels
        facts = [f"name=uav{uav}", "imDir=img1", f"frameRate={scenario.rates.sensing}"]
        facts += [f"seqLength={len(recording.times)}", f"imWidth={pixels}", f"imHeight={pixels}", "imExt=.png"]
        (sequence / "seqinfo.ini").write_text("\n".join(["[Sequence]", *facts]) + "\n", encoding="utf-8")


def _mot_row(k: int, id: int, position: Sequence[float]) -> Row:
    """A row: frame (from 1), id (from 1, or -1), box -1, confidence 1, position on the ground."""
    return [k + 1, id, -1, -1, -1, -1, 1, *position, 0]


TARGETS: dict[str, Callable[[Recording, Path], None]] = {"csv": _csv, "stonesoup": _stonesoup, "mot": _mot}


def _scan_rows(recording: Recording) -> Iterator[Row]:
    """A row for each measurement, and an empty one for each scan without measurements."""
    for k, uav in np.argwhere(frames_taken(recording)).tolist():
        scan = recording.scan_at(k, uav)
        pose = recording.cameras[k, uav].tolist()
        for z, R in zip(scan.measurements.tolist(), scan.covariances.tolist(), strict=True):
            yield [scan.time, uav, *z, R[0][0], R[0][1], R[1][1], *pose]
        if len(scan.measurements) == 0:
            yield [scan.time, uav, *[""] * 5, *pose]


def _measurements(recording: Recording) -> Rows:
    """Scan, UAV, time, and x, y, xx, xy, yy of each measurement."""
    z, R = recording.measurements, recording.measurement_covariances
    return _rows(recording, recording.cells(recording.measurement_offsets), *z.T, R[:, 0, 0], R[:, 0, 1], R[:, 1, 1])


def _tracks(recording: Recording) -> Rows:
    """A row for each track of working UAVs: scan, UAV and time.

    Then come the mark of a reported track, id, state, covariance and existence (NaN if unknown).
    """
    row, column = np.triu_indices(4)
    covariances = recording.track_covariances[:, row, column]
    state = *recording.track_means.T, *covariances.T
    columns = recording.reported, recording.track_ids, *state, recording.existence
    rows = _rows(recording, recording.cells(recording.track_offsets), *columns)
    return (row for row in rows if recording.working[row[0], row[1]])


def _truth(recording: Recording) -> Rows:
    """A row for each person present: scan, number, time, position and velocity."""
    cells = np.nonzero(~np.isnan(recording.people[:, :, 0]))
    return _rows(recording, cells, *recording.people[cells].T, *velocities(recording)[cells].T)


def _rows(recording: Recording, cells: tuple[Indices, ...], *columns: Array | Indices | Flags) -> Rows:
    """Rows of scan, index of UAV or person, time [s] and further columns (N,), as Python numbers."""
    table = (*cells, recording.times[cells[0]], *columns)
    return zip(*(column.tolist() for column in table), strict=True)


def _table(path: Path, header: Sequence[str], rows: Iterable[Row]) -> None:
    """Write a CSV file, in which floats have as many digits as are needed to read the same values."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerows([header] if header else [])
        table.writerows(rows)
