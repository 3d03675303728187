"""A flight as CSV files: poses, detections, cameras and trees, which `track` reads as `export --to csv` writes them."""

import csv
import json
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.exchange.values import (
    COVARIANCE,
    STATE,
    TRACK,
    CameraFrames,
    LoggedCamera,
    LoggedDetection,
    LoggedFrame,
    PoseLog,
    find_attitudes,
    list_rows,
    list_tracks,
    list_truth,
    make_calibrated_camera,
    make_square_camera,
)
from sim.mission.recording import Recording
from sim.scenario.camera_settings import CameraSettings, make_camera, read_camera
from sim.scenario.csv_tables import TableRow, read_csv
from sim.scenario.geo import NOWHERE_ON_THE_MAP, Geo
from sim.scenario.scenario import leave_out_removed_keys
from sim.scenario.settings_text import format_toml
from sim.scenario.uavs import Uav, measure_angle
from sim.world.stem_map import TREE_COLUMNS
from sim.world.terrain import UNKNOWN_GROUND, Terrain
from tracking.errors import InputError, spell
from tracking.geometry.camera import Camera
from tracking.settings import read_settings

_PLACE = ("x_m", "y_m")
_HEIGHTS = {"z_m": 1.0, "z_ft": 0.3048, "altitude_m": 1.0, "altitude_ft": 0.3048}  # in m; altitudes are above the sea
_SIZES = ("width_px", "height_px")
_GIVEN = ("pose_offset_s", "height_m")  # columns of cameras, beside angles, that complete logs
QUATERNION = ("qx", "qy", "qz", "qw")
ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")
_PIXEL = ("u_px", "v_px")
_CLASSES = ("class_name", "class", "category", "label", "class_id", "category_id")  # of columns; names before numbers
_SCORES = ("score", "confidence", "conf")
_PARTS = {"place": _PLACE, "covariance": ("xx_m2", "xy_m2", "yy_m2"), "pixel": _PIXEL}  # of a detection
POSE_COLUMNS = ("time_s", "uav", *_PLACE, "z_m", *QUATERNION)
DETECTION_COLUMNS = ("time_s", "uav", *_PLACE, *_PARTS["covariance"], *_PIXEL)
CAMERA_COLUMNS = ("uav", "fov_deg", "pixels")
_VIEWS = ("hfov_deg", "vfov_deg", "dfov_deg", "focal_mm", "sensor_width_mm")  # keys of a camera that columns may give
_CLOCK = {"time": "time_s", "timestamp": "time_s", "datetime": "time_s", "time_utc": "time_s"}
_TUM = {"timestamp": "time_s", "tx": "x_m", "ty": "y_m", "tz": "z_m"}  # names of TUM's trajectories
# Columns of each file that are read, by the names that stand for them.
KNOWN = {
    "poses": _TUM | _CLOCK | {name: name for name in (*POSE_COLUMNS, *ANGLES, *_HEIGHTS)},
    "detections": _CLOCK | {name: name for name in (*DETECTION_COLUMNS, *_CLASSES, *_SCORES)},
    "cameras": {
        name: name for name in (*CAMERA_COLUMNS, *_SIZES, *_VIEWS, "camera", "clock_offset_s", "axes", *_GIVEN, *ANGLES)
    },
    "images": _CLOCK | {name: name for name in ("time_s", "uav", "file")},
}
# Endings of columns by which `tracks.csv` names units.
_UNITS = {"time": "_s", **dict(zip(STATE, ("_m", "_m", "_m_per_s", "_m_per_s"), strict=True))}
_UNITS |= {name: ("_m2", "_m2_per_s", "_m2_per_s2")[name.count("v")] for name in COVARIANCE}

_ROUNDED = 1e-9  # error of a quaternion's norm up to which it stays
_WRONG = 1e-2  # error of a quaternion's norm from which it is refused
_WHOLE = 0.5  # largest error of a number that was rounded to a whole one
Cells = Sequence[float | int | str]  # of a row


def read_poses(path: Path, geo: Geo = NOWHERE_ON_THE_MAP, ground: Terrain = UNKNOWN_GROUND) -> dict[int, PoseLog]:
    """Poses of the camera of each UAV, from a CSV file with the columns `POSE_COLUMNS`.

    In place of the quaternion, yaw_deg, pitch_deg and roll_deg are those of a gimbal: yaw clockwise from north, pitch
    -90 straight down. Without both, cameras look straight down, with north at the top of the image. Without the column
    uav all rows are of UAV 0. Equal rows count once. In place of z_m there may be altitude_m, above the sea, and both
    may be in feet. geo: where the map is. ground: from which altitudes count. InputError names file, line and column
    of a wrong entry.
    """
    first = next(read_csv(path, "poses", (), spares=KNOWN["poses"], geo=geo), None)
    height = next((name for name in _HEIGHTS if first and name in first.values), "z_m")
    if height.startswith("altitude") and not ground.is_known:
        asked = "--set geo.ground=G gives the ground [m], or ground.file"
        raise InputError(f"poses: {path}, column {height}: is above the sea; {asked}")
    found: defaultdict[int, dict[float, list[float]]] = defaultdict(dict)
    lines: dict[tuple[int, float], int] = {}
    for row in read_csv(path, "poses", ("time_s", *_PLACE, height), spares=KNOWN["poses"], geo=geo):
        uav, time = read_uav(row), row.time("time_s")
        z = row.number(height) * _HEIGHTS[height]
        pose = [row.number("x_m"), row.number("y_m"), z, *_read_attitude(row)]
        if (uav, time) in lines and found[uav][time] != pose:
            twice = f"UAV {uav} has another pose at {spell(time)} s in line {lines[uav, time]}"
            raise row.error("uav", f"{twice}; number the UAVs apart")
        lines[uav, time] = row.line
        found[uav][time] = pose
    if not found:
        raise InputError(f"poses: {path}: holds no pose")
    ordered = {uav: sorted(poses.items()) for uav, poses in sorted(found.items())}
    logs = {uav: PoseLog(*map(np.array, zip(*rows, strict=True))) for uav, rows in ordered.items()}
    for uav, log in logs.items() if height.startswith("altitude") else ():
        log.rows[:, 2] -= ground.find_heights(log.rows[:, :2], f"UAV {uav}")
    return logs


def has_quaternions(path: Path) -> bool:
    """True if attitudes in a file of poses are quaternions."""
    row = next(read_csv(path, "poses", (), spares=KNOWN["poses"]), None)
    return row is not None and {*QUATERNION} <= {*row.values} and not {*ANGLES} & {*row.values}


def read_detections(path: Path, geo: Geo = NOWHERE_ON_THE_MAP) -> dict[int, CameraFrames]:
    """Frames of each UAV with their detections, from a CSV file with some of the columns `DETECTION_COLUMNS`.

    A row is a detection: a place on the ground, maybe with its covariance, or the pixel of the person's mid-height. A
    row with neither says that the camera took a frame at this time. There may be a column class and a column score.
    Rows may have any order. geo: where the map is. InputError names file, line and column of a wrong entry.
    """
    found: defaultdict[int, dict[float, LoggedFrame]] = defaultdict(dict)
    rows: dict[tuple[int, float, LoggedDetection], int] = {}
    for row in read_csv(path, "detections", ("time_s",), spares=KNOWN["detections"], geo=geo):
        if not found and not {*_PLACE} <= {*row.values} and not {*_PIXEL} <= {*row.values}:
            raise InputError(f"detections: {path}, line 1: names neither x_m and y_m nor u_px and v_px")
        uav, time = read_uav(row), row.time("time_s")
        frame = found[uav].setdefault(time, LoggedFrame(time, row.where, []))
        detection = _read_detection(row)
        if detection is None:
            continue
        if (line := rows.setdefault((uav, time, detection), row.line)) != row.line:
            raise row.error("time_s", f"the same detection of this frame is in line {line}")
        frame.detections.append(detection)
    if not found:
        raise InputError(f"detections: {path}: holds no frame")
    return {uav: CameraFrames([frames[time] for time in sorted(frames)]) for uav, frames in sorted(found.items())}


def read_cameras(path: Path) -> dict[int, LoggedCamera]:
    """The camera of each UAV, from a CSV file with the columns `CAMERA_COLUMNS`.

    There may be clock_offset_s, and width_px and height_px of images that are not square: fov_deg is over a square of
    `pixels` in the middle. In place of these two, there may be hfov_deg, which is over the width, or the column
    camera: a packaged camera, or a file beside this one, with which the others then have to agree. axes are those of
    quaternions. What logs lack may be given, too: the columns of a gimbal's angles, and height_m; and pose_offset_s.
    """
    cameras: dict[int, LoggedCamera] = {}
    for row in read_csv(path, "cameras", (), spares=KNOWN["cameras"]):
        uav = read_uav(row)
        if uav in cameras:
            raise row.error("uav", f"UAV {uav} has a second row")
        offset = row.optional_number("clock_offset_s") or 0.0
        axes = row.values.get("axes") or "image"
        given = {name: value for name in (*_GIVEN, *ANGLES) if (value := row.optional_number(name)) is not None}
        cameras[uav] = _read_view(row, path)._replace(clock_offset=offset, axes=axes, given=given)
    return cameras


def _read_view(row: TableRow, path: Path) -> LoggedCamera:
    if name := row.values.get("camera"):
        try:
            settings = read_camera(str(path.parent / name) if Path(name).suffix else name)
        except InputError as error:
            raise row.error("camera", str(error)) from error
        _check_view(row, make_camera(settings))
        return make_calibrated_camera(settings)
    across = {name: row.number(name) for name in _VIEWS if row.values.get(name)}
    if across and row.values.get("fov_deg"):
        raise row.error(next(iter(across)), "fov_deg is given as well; allowed is one of them")
    for column in ("width_px", "height_px") if across else CAMERA_COLUMNS[1:]:
        if column not in row.values:
            there = ",".join(row.values)
            raise InputError(f"cameras: {path}, line 1: column {column} is missing; columns are {there}")
    try:
        if across:
            size = {"width": row.integer("width_px"), "height": row.integer("height_px")}
            settings = read_settings({**size, **across}, CameraSettings)
            _check_view(row, make_camera(settings))
            return make_calibrated_camera(settings)
        square = make_square_camera(fov_deg := row.number("fov_deg"), pixels := row.integer("pixels"))
        width, height = (row.integer(name) if row.values.get(name) else pixels for name in ("width_px", "height_px"))
        if pixels > min(width, height):
            more = f"pixels: {pixels} is more than an edge of the images of {width} × {height} pixels"
            square_of = "fov_deg is over a square of this edge in their middle"
            raise InputError(f"{more}; {square_of}; if {fov_deg:g} is over the width, call it hfov_deg")
        return square if width == height == pixels else square.widen((width, height))
    except InputError as error:
        raise InputError(str(error) if str(error).startswith(row.where) else f"{row.where}: {error}") from error


def _check_view(row: TableRow, camera: Camera) -> None:
    """InputError if what a row says of its camera's view is not so, by more than rounding to whole numbers."""
    (width, height), pixels = camera.size, row.optional_number("pixels")
    over = width if pixels is None else max(1, min(width, round(pixels)))
    own: dict[str, float] = {"pixels": over, "width_px": width, "height_px": height}
    own |= {"hfov_deg": measure_angle(camera, width), "fov_deg": measure_angle(camera, over)}
    for column, value in own.items():
        given = row.optional_number(column)
        if given is not None and abs(given - value) > _WHOLE:
            other = f"{spell(given)} is not that of the camera, which has {spell(value, 4)}; leave it out"
            raise row.error(column, other)


def read_uav(row: TableRow) -> int:
    """Number of the UAV of a row, 0 in a table without this column."""
    return row.integer("uav") if "uav" in row.values else 0


def _read_attitude(row: TableRow) -> list[float]:
    """Quaternion xyzw of the camera."""
    if any(name in row.values for name in ANGLES):
        yaw, pitch, roll = (row.optional_number(name) or 0.0 for name in ANGLES)
        pitch = pitch if ANGLES[1] in row.values else -90.0
        return [float(part) for part in find_attitudes(np.array([[yaw, pitch, roll]]))[0]]
    if not any(name in row.values for name in QUATERNION):
        return [0.0, 0.0, 0.0, 1.0]
    if not {*QUATERNION} <= {*row.values}:
        raise InputError(f"{row.where}: columns {', '.join(QUATERNION)} belong together; one of them is missing")
    quaternion = [row.number(name) for name in QUATERNION]
    norm = math.hypot(*quaternion)
    if abs(norm - 1) > _WRONG:
        raise row.error("qx", f"the quaternion's norm is {norm:g}, not 1")
    return quaternion if abs(norm - 1) <= _ROUNDED else [part / norm for part in quaternion]


def _read_detection(row: TableRow) -> LoggedDetection | None:
    """The detection of a row; None if it has none."""
    found: dict[str, Any] = {}
    for part, columns in _PARTS.items():
        if any(row.values.get(column) for column in columns):  # all of what a row has a part of is needed
            if not {*columns} <= {*row.values}:
                raise InputError(f"{row.where}: columns {', '.join(columns)} belong together; one of them is missing")
            found[part] = tuple(row.number(column) for column in columns)
    if "covariance" in found:
        xx, xy, yy = found["covariance"]
        if not (xx > 0 and xx * yy > xy * xy):
            parts = ", ".join(map(spell, (xx, xy, yy)))
            raise row.error("xx_m2", f"xx_m2, xy_m2, yy_m2 of {parts} are not positive definite")
        if "place" not in found:
            raise row.error("x_m", "is empty, but the covariance is that of a place on the ground")
    if not found:
        return None
    category = next((row.values[name] for name in _CLASSES if name in row.values), "")
    scores = (row.optional_number(name) for name in _SCORES)
    score = next((score for score in scores if score is not None), math.nan)
    return LoggedDetection(**found, category=category, score=score)


def write_csv(recording: Recording, folder: Path) -> None:
    """The files of a flight, and its tracks and people; `truth.csv` also works as `people.trajectories`."""
    times = recording.times.tolist()
    rows = zip(times, recording.believed_cameras.tolist(), strict=True)
    poses = ([time, i, *pose] for time, fleet in rows for i, pose in enumerate(fleet))
    write_table(folder / "poses.csv", POSE_COLUMNS, poses)
    write_table(folder / "detections.csv", DETECTION_COLUMNS, _list_detections(recording))
    header = [name + _UNITS.get(name, "") for name in TRACK]
    write_table(folder / "tracks.csv", header, sorted(list_rows(list_tracks(recording), TRACK)))
    _write_cameras(recording, folder)
    write_truth(recording, folder)
    write_map_and_settings(recording, folder)


def write_truth(recording: Recording, folder: Path, *, start: float = 0.0) -> None:
    """Write the people into `truth.csv`, if they are known; start: time there [s] of the first scan."""
    if recording.labelled:
        truth = list_truth(recording)
        rows = list_rows({**truth, "time": truth["time"] + start}, ("time", "person", "x", "y"))
        write_table(folder / "truth.csv", ("time_s", "id", "x_m", "y_m"), rows)


def write_map_and_settings(recording: Recording, folder: Path, *, truth: bool = True) -> None:
    """Write `scenario.toml` and `trees.csv`; truth: False for cameras as the fleet believes them to be."""
    settings = leave_out_removed_keys(json.loads(recording.scenario))
    for uav, table in zip(recording.setting.uavs, settings["uavs"], strict=True):
        if uav.camera and not truth:
            table["camera"] = _describe_calibration(uav)
    flown = settings | {"duration": float(recording.times[-1]) or recording.setting.duration}
    (folder / "scenario.toml").write_text(format_toml(flown), encoding="utf-8")
    trees = [["" if math.isinf(value) else value for value in row] for row in recording.trees.tolist()]
    write_table(folder / "trees.csv", TREE_COLUMNS[: recording.trees.shape[1]], trees)


def write_table(path: Path, header: Sequence[str], rows: Iterable[Cells]) -> None:
    """Write a CSV file, in which floats have as many digits as are needed to read the same values."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerows([header] if header else [])
        table.writerows(rows)


def _list_detections(recording: Recording) -> Iterator[Cells]:
    """A row for each measurement, and an empty one for each frame without measurements."""
    pixels = recording.pixels.tolist()
    for k, uav in np.argwhere(recording.frames_taken).tolist():
        scan = recording.scan_at(k, uav)
        first = int(recording.measurement_offsets[k * recording.uav_count + uav])
        for n, (z, R) in enumerate(zip(scan.measurements.tolist(), scan.covariances.tolist(), strict=True)):
            pixel = ["" if math.isnan(part) else part for part in pixels[first + n]]
            yield [scan.time, uav, *z, R[0][0], R[0][1], R[1][1], *pixel]
        if len(scan.measurements) == 0:
            yield [scan.time, uav, *[""] * 7]


def _describe_calibration(uav: Uav) -> dict[str, Any]:
    """The keys of a calibrated camera, as the fleet believes it to be."""
    o = uav.believed_camera.optics
    calibration = {"focal": [o.fx, o.fy], "centre": [o.cx - 0.5, o.cy - 0.5]}
    return {"width": o.width, "height": o.height, **calibration, **o.distortion.settings}


def _write_cameras(recording: Recording, folder: Path) -> None:
    """Write `cameras.csv`, and a file for each calibrated camera, as the fleet believes it to be."""
    uavs = recording.setting.uavs
    rows: list[list[float | int | str]] = []
    for i, uav in enumerate(uavs):
        rows.append([i, uav.fov_deg, uav.pixels, ""])
        if uav.camera:
            rows[-1][1:] = [measure_angle(uav.believed_camera, uav.pixels), uav.pixels, f"camera{i}.toml"]
            text = format_toml(_describe_calibration(uav))
            (folder / f"camera{i}.toml").write_text(text, encoding="utf-8")
    columns = [*CAMERA_COLUMNS, *["camera"] * any(uav.camera for uav in uavs)]
    write_table(folder / "cameras.csv", columns, (row[: len(columns)] for row in rows))
