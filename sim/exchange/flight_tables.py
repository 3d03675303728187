"""Tables of a flight: poses, detections, cameras and trees in CSV files, as `export --to csv` writes them."""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from sim.scenario.camera_settings import CameraSettings, make_camera, read_camera
from sim.scenario.csv_tables import TableRow, read_csv
from sim.scenario.environment import Trees
from sim.world.stem_map import read_stem_map
from tracking.errors import InputError, spell
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import tan

_PLACE = ("x_m", "y_m")
_QUATERNION = ("qx", "qy", "qz", "qw")
_ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")
_COVARIANCE = ("xx_m2", "xy_m2", "yy_m2")
_PIXEL = ("u_px", "v_px")
POSE_COLUMNS = ("time_s", "uav", *_PLACE, "z_m", *_QUATERNION)
DETECTION_COLUMNS = ("time_s", "uav", *_PLACE, *_COVARIANCE, *_PIXEL)
CAMERA_COLUMNS = ("uav", "fov_deg", "pixels")
TREE_COLUMNS = ("x_m", "y_m", "canopy_radius_m", "canopy_base_m", "canopy_top_m", "trunk_radius_m")
TREE_LEAVES = "leaf_area_density_m2_per_m3"  # one more column, if any canopy is porous; empty for those that are opaque

_ROUNDED, _WRONG = 1e-9, 1e-2  # errors of a quaternion's norm up to which it stays, and from which it is refused
_NONE = (math.nan, math.nan)


class Poses(NamedTuple):
    """Poses of one UAV's camera in order of time."""

    times: Array  # (P,) s
    rows: Array  # (P, 7), position [m] and quaternion xyzw


class Detection(NamedTuple):
    """One detection, on the ground or in the image; NaN for what is not known."""

    place: tuple[float, float] = _NONE  # m
    covariance: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # xx, xy, yy [m²]
    pixel: tuple[float, float] = _NONE  # of the person's mid-height
    person: str = ""  # id, if this is a label


class LoggedFrame(NamedTuple):
    """The detections of one frame."""

    time: float  # s
    where: str  # file, and line of the first detection
    detections: list[Detection]


class CameraRow(NamedTuple):
    """The camera of one UAV."""

    view: Mapping[str, Any]  # `fov_deg` and `pixels`, or `camera`, of a UAV of a scenario
    size: tuple[int, int]  # width and height of the images [pixel]
    clock_offset: float = 0.0  # s, to add to the UAV's times

    @staticmethod
    def square(fov_deg: float, pixels: int) -> "CameraRow":
        """A camera of square images."""
        return CameraRow({"fov_deg": fov_deg, "pixels": pixels}, (pixels, pixels))

    @staticmethod
    def calibrated(settings: CameraSettings) -> "CameraRow":
        """A calibrated camera."""
        return CameraRow({"camera": msgspec.to_builtins(settings)}, make_camera(settings).size)

    def fit(self, size: tuple[int, int], where: str) -> "CameraRow":
        """The camera of images of this size: of wide ones, if its own square is that in their middle; else InputError.

        The square has the shorter edge of wide images.
        """
        if self.size == size:
            return self
        width, height = self.size
        own = str(width) if width == height else f"{width} × {height}"
        images = f"images have {size[0]} × {size[1]} pixels, but the camera in cameras.csv has {own}"
        if "pixels" not in self.view:
            raise InputError(f"{where}: {images}; expected its own size")
        if width != min(size):
            raise InputError(f"{where}: {images}; give it {min(size)}, and the angle of view over these")
        return self.widen(size)

    def widen(self, size: tuple[int, int]) -> "CameraRow":
        """The camera of wide images with this one as their middle square."""
        focal = self.view["pixels"] / 2 / tan(math.radians(self.view["fov_deg"]) / 2)
        whole = CameraSettings(width=size[0], height=size[1], focal=(focal, focal))
        return CameraRow.calibrated(whole)._replace(clock_offset=self.clock_offset)


Fleet = dict[int, list[LoggedFrame]]  # frames in order of time, by UAV


class CameraFrames(NamedTuple):
    """Frames of one camera."""

    detections: list[LoggedFrame]
    people: Sequence[LoggedFrame] = ()  # with the ids of people, if they are known
    size: tuple[int, int] | None = None  # width and height of the images, if known


def measure_gap(frames: Sequence[LoggedFrame]) -> float:
    """The usual time [s] from one frame to the next; 0 for a single one."""
    return float(np.median(np.diff([frame.time for frame in frames]))) if len(frames) > 1 else 0.0


def read_poses(path: Path) -> dict[int, Poses]:
    """Poses of the camera of each UAV, from a CSV file with the columns `POSE_COLUMNS`.

    In place of the quaternion, yaw_deg, pitch_deg and roll_deg are those of a gimbal: yaw clockwise from north, pitch
    -90 straight down. Without both, cameras look straight down, with north at the top of the image. Without the column
    uav all rows are of UAV 0. InputError names file, line and column of a wrong entry.
    """
    found: defaultdict[int, dict[float, list[float]]] = defaultdict(dict)
    lines: dict[tuple[int, float], int] = {}
    for row in read_csv(path, "poses", ("time_s", *_PLACE, "z_m")):
        uav, time = read_uav(row), row.number("time_s")
        if (uav, time) in lines:
            twice = f"UAV {uav} has another pose at {spell(time)} s in line {lines[uav, time]}"
            raise row.error("uav", f"{twice}; number the UAVs apart")
        lines[uav, time] = row.line
        found[uav][time] = [row.number("x_m"), row.number("y_m"), row.number("z_m"), *_read_attitude(row)]
    if not found:
        raise InputError(f"poses: {path}: holds no pose")
    ordered = {uav: sorted(poses.items()) for uav, poses in sorted(found.items())}
    return {uav: Poses(*map(np.array, zip(*rows, strict=True))) for uav, rows in ordered.items()}


def read_detections(path: Path) -> Fleet:
    """Frames of each UAV with their detections, from a CSV file with some of the columns `DETECTION_COLUMNS`.

    A row is a detection: a place on the ground, maybe with its covariance, or the pixel of the person's mid-height. A
    row with neither says that the camera took a frame at this time. Rows may have any order. InputError names file,
    line and column of a wrong entry.
    """
    found: defaultdict[int, dict[float, LoggedFrame]] = defaultdict(dict)
    rows: dict[tuple[int, float, Detection], int] = {}
    for row in read_csv(path, "detections", ("time_s",)):
        if not found and not {*_PLACE} <= {*row.values} and not {*_PIXEL} <= {*row.values}:
            raise InputError(f"detections: {path}, line 1: names neither x_m and y_m nor u_px and v_px")
        uav, time = read_uav(row), row.number("time_s")
        frame = found[uav].setdefault(time, LoggedFrame(time, row.where, []))
        detection = _read_detection(row)
        if detection is None:
            continue
        if (line := rows.setdefault((uav, time, detection), row.line)) != row.line:
            raise row.error("time_s", f"the same detection of this frame is in line {line}")
        frame.detections.append(detection)
    if not found:
        raise InputError(f"detections: {path}: holds no frame")
    return {uav: [frames[time] for time in sorted(frames)] for uav, frames in sorted(found.items())}


def read_cameras(path: Path) -> dict[int, CameraRow]:
    """The camera of each UAV, from a CSV file with the columns `CAMERA_COLUMNS`.

    There may be clock_offset_s, and width_px and height_px of images that are not square. In place of angle of view and
    pixels, there may be the column camera: a packaged camera, or a file beside this one.
    """
    cameras: dict[int, CameraRow] = {}
    for row in read_csv(path, "cameras", ()):
        uav = read_uav(row)
        if uav in cameras:
            raise row.error("uav", f"UAV {uav} has a second row")
        offset = row.optional_number("clock_offset_s") or 0.0
        cameras[uav] = _read_view(row, path)._replace(clock_offset=offset)
    return cameras


def _read_view(row: TableRow, path: Path) -> CameraRow:
    if name := row.values.get("camera"):
        try:
            return CameraRow.calibrated(read_camera(str(path.parent / name) if Path(name).suffix else name))
        except InputError as error:
            raise row.error("camera", str(error)) from error
    for column in CAMERA_COLUMNS[1:]:
        if column not in row.values:
            there = ",".join(row.values)
            raise InputError(f"cameras: {path}, line 1: column {column} is missing; columns are {there}")
    square = CameraRow.square(row.number("fov_deg"), pixels := row.integer("pixels"))
    width, height = (row.integer(name) if row.values.get(name) else pixels for name in ("width_px", "height_px"))
    if pixels > min(width, height):
        raise row.error("pixels", f"{pixels} is more than an edge of the images of {width} × {height} pixels")
    return square if width == height == pixels else square.widen((width, height))


def read_forest(path: Path, origin: tuple[float, float] = (0.0, 0.0)) -> Forest:
    """The trees from a CSV file with the columns `TREE_COLUMNS`, or any other stem map; `origin` [m] is subtracted."""
    return Forest(read_stem_map(path, "trees", Trees(origin=origin), least=0.0).trees)


def read_uav(row: TableRow) -> int:
    """Number of the UAV of a row, 0 in a table without this column."""
    return row.integer("uav") if "uav" in row.values else 0


def _read_attitude(row: TableRow) -> list[float]:
    """Quaternion xyzw of the camera."""
    if any(name in row.values for name in _ANGLES):
        yaw, pitch, roll = (math.radians(row.optional_number(name) or 0.0) for name in _ANGLES)
        # Turns about the camera's z, then x, then z axis.
        turned = Rotation.from_euler("ZXZ", [-yaw, math.pi / 2 + pitch, -roll])
        return [float(part) for part in turned.as_quat()]
    if not any(name in row.values for name in _QUATERNION):
        return [0.0, 0.0, 0.0, 1.0]
    quaternion = [row.number(name) for name in _QUATERNION]
    norm = math.hypot(*quaternion)
    if abs(norm - 1) > _WRONG:
        raise row.error("qx", f"the quaternion's norm is {norm:g}, not 1")
    return quaternion if abs(norm - 1) <= _ROUNDED else [part / norm for part in quaternion]


def _read_detection(row: TableRow) -> Detection | None:
    """The detection of a row; None if it has none."""
    given = [names for names in (_PLACE, _COVARIANCE, _PIXEL) if any(row.values.get(name) for name in names)]
    if not given:
        return None
    for names in given:  # all of what a row has a part of is needed
        if not {*names} <= {*row.values}:
            raise InputError(f"{row.where}: columns {', '.join(names)} belong together; one of them is missing")
    detection = Detection()
    if _PLACE in given:
        detection = detection._replace(place=(row.number("x_m"), row.number("y_m")))
    if _PIXEL in given:
        detection = detection._replace(pixel=(row.number("u_px"), row.number("v_px")))
    if _COVARIANCE in given:
        xx, xy, yy = (row.number(name) for name in _COVARIANCE)
        if not (xx > 0 and xx * yy > xy * xy):
            parts = ", ".join(map(spell, (xx, xy, yy)))
            raise row.error("xx_m2", f"xx_m2, xy_m2, yy_m2 of {parts} are not positive definite")
        if _PLACE not in given:
            raise row.error("x_m", "is empty, but the covariance is that of a place on the ground")
        detection = detection._replace(covariance=(xx, xy, yy))
    return detection
