"""A recording in the formats of other tools: scans, tracks and truth as text, every number to its last digit."""

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from sim.evaluation.score import velocities
from sim.recording.atomic_files import new_folder
from sim.recording.recording import Recording
from sim.replay.frames.rerender import scenario_of
from sim.sensing.cameras import view_of
from sim.world.trajectories import COLUMNS as PEOPLE_COLUMNS
from tracking.measurement_files import CAMERA_COLUMNS, SCAN_COLUMNS, TREE_COLUMNS
from tracking.plugins.registry import check_known

Row = Sequence[float | int | str]
STATE = ("x", "y", "vx", "vy")  # m, m/s
# Upper triangle of a covariance by rows, named by the states that it is of.
COVARIANCE = tuple(a + b for i, a in enumerate(STATE) for b in STATE[i:])
_UPPER = np.triu_indices(4)
_TRACK = ("id", *STATE, *COVARIANCE, "existence")


def export(recording: Recording, target: str, out: Path) -> None:
    """Write a recording into the new folder `out`, whole or not at all; InputError where target or folder is wrong.

    target: `csv`, `stonesoup` or `mot`; docs/how-to/tracking.md tells files and columns.
    """
    write = writer(target)
    with new_folder(out) as folder:
        write(recording, folder)


def writer(target: str) -> Callable[[Recording, Path], None]:
    """The writer of a target's files; InputError names the nearest target if there is no such."""
    check_known("--to", target, TARGETS)
    return TARGETS[target]


def _csv(recording: Recording, folder: Path) -> None:
    """Tables that `tracking.measurement_files` reads; the truth can be flown again as `people.trajectories`."""
    _table(folder / "scans.csv", SCAN_COLUMNS, _scan_rows(recording))
    tracks = ([time, uav, *row] for uav in _uavs(recording) for _, time, row in _track_rows(recording, uav))
    _table(folder / "tracks.csv", ("time", "uav", *_TRACK), sorted(tracks))
    _table(folder / "truth.csv", PEOPLE_COLUMNS, ([time, m, *xy] for _, time, m, xy in _truth(recording)))
    scenario = scenario_of(recording)
    cameras = [view_of(uav, scenario) for uav in scenario.uavs]
    _table(folder / "cameras.csv", CAMERA_COLUMNS, ([i, camera.fov, camera.pixels] for i, camera in enumerate(cameras)))
    _table(folder / "trees.csv", TREE_COLUMNS, recording.trees.tolist())


def _stonesoup(recording: Recording, folder: Path) -> None:
    """Files for the CSV readers of `stonesoup.reader.generic`, one of detections and tracks for each UAV.

    A reader makes a set of the rows of one time, and Stone Soup's association takes a set for the scan of one sensor.
    """
    for uav in _uavs(recording):
        _table(
            folder / f"detections-uav{uav}.csv",
            ("time", "x", "y", "xx", "xy", "yy"),
            ([time, *row] for _, time, row in _measurement_rows(recording, uav)),
        )
        tracks = ([time, *row] for _, time, row in _track_rows(recording, uav))
        _table(folder / f"tracks-uav{uav}.csv", ("time", *_TRACK), tracks)
    v = velocities(recording)
    truth = ([time, m, *xy, *v[k, m].tolist()] for k, time, m, xy in _truth(recording))
    _table(folder / "groundtruth.csv", ("time", "id", *STATE), truth)
    looks = ([float(recording.times[k]), i, *recording.cameras[k, i, :3].tolist()] for k, i in _looks(recording))
    _table(folder / "sensors.csv", ("time", "uav", "x", "y", "z"), looks)


def _mot(recording: Recording, folder: Path) -> None:
    """MOTChallenge's text in its 3-D variant: a sequence for each UAV, boxes -1, positions on the ground in m."""
    scenario = scenario_of(recording)
    (folder / "tracks").mkdir()
    for uav in _uavs(recording):
        sequence = folder / f"uav{uav}"
        for name in ("gt", "det"):
            (sequence / name).mkdir(parents=True)
        truth = (_mot_row(k, m + 1, xy) for k, _, m, xy in _truth(recording))
        _table(sequence / "gt" / "gt.txt", (), truth)
        found = (_mot_row(k, -1, row[:2]) for k, _, row in _measurement_rows(recording, uav))
        _table(sequence / "det" / "det.txt", (), found)
        tracks = (_mot_row(k, int(row[0]) + 1, row[1:3]) for k, _, row in _track_rows(recording, uav))
        _table(folder / "tracks" / f"uav{uav}.txt", (), tracks)
        facts = {
            "name": f"uav{uav}",
            "imDir": "img1",
            "frameRate": scenario.rates.sensing,
            "seqLength": len(recording.times),
            "imWidth": scenario.uavs[uav].pixels,
            "imHeight": scenario.uavs[uav].pixels,
            "imExt": ".png",
        }
        lines = ["[Sequence]", *(f"{key}={value}" for key, value in facts.items())]
        (sequence / "seqinfo.ini").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _mot_row(k: int, id: int, position: Sequence[float]) -> Row:
    """Frame from 1, id from 1 or -1, box -1, confidence 1, position on the ground."""
    return [k + 1, id, -1, -1, -1, -1, 1, *position, 0]


TARGETS: dict[str, Callable[[Recording, Path], None]] = {"csv": _csv, "stonesoup": _stonesoup, "mot": _mot}


def _uavs(recording: Recording) -> range:
    return range(recording.poses.shape[1])


def _looks(recording: Recording) -> Iterator[tuple[int, int]]:
    """Scan and UAV wherever a camera of a UAV that works took a frame."""
    scenario, on = scenario_of(recording), recording.working
    return ((k, i) for k in range(len(on)) for i in _uavs(recording) if on[k, i] and scenario.has_frame(i, k))


def _scan_rows(recording: Recording) -> Iterator[Row]:
    """A row for each measurement, and one without for each scan that has none."""
    for k, uav in _looks(recording):
        scan = recording.scan_at(k, uav)
        pose = recording.cameras[k, uav].tolist()
        for z, R in zip(scan.measurements.tolist(), scan.covariances.tolist(), strict=True):
            yield [scan.time, uav, *z, R[0][0], R[0][1], R[1][1], *pose]
        if len(scan.measurements) == 0:
            yield [scan.time, uav, *[""] * 5, *pose]


def _measurement_rows(recording: Recording, uav: int) -> Iterator[tuple[int, float, list[float]]]:
    """Scan, time, and x, y, xx, xy, yy of each measurement of one UAV."""
    for k, time in enumerate(recording.times.tolist()):
        scan = recording.scan_at(k, uav)
        for z, R in zip(scan.measurements.tolist(), scan.covariances.tolist(), strict=True):
            yield k, time, [*z, R[0][0], R[0][1], R[1][1]]


def _track_rows(recording: Recording, uav: int) -> Iterator[tuple[int, float, list[float]]]:
    """Scan, time, and id, state, covariance and existence (NaN if unknown) of each track of one UAV while it works."""
    for k in np.flatnonzero(recording.working[:, uav]).tolist():
        known = recording.existence_at(k, uav).tolist()
        for track, r in zip(recording.tracks_at(k, uav), known, strict=True):
            state, covariance = track.belief.mean.tolist(), track.belief.covariance[_UPPER].tolist()
            yield k, float(recording.times[k]), [track.id, *state, *covariance, r]


def _truth(recording: Recording) -> Iterator[tuple[int, float, int, list[float]]]:
    """Scan, time, number and position of all people present."""
    for k, people in enumerate(recording.people):
        for m in np.flatnonzero(~np.isnan(people[:, 0])).tolist():
            yield k, float(recording.times[k]), m, people[m].tolist()


def _table(path: Path, header: Sequence[str], rows: Iterable[Row]) -> None:
    """A CSV file; Python writes a float with as many digits as it takes to read the same float again."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerows([header] if header else [])
        table.writerows(rows)
