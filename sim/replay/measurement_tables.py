"""Scans, cameras and trees from the CSV files of `export --to csv`, or of other sources, for trackers."""

import math
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np

from sim.scenario.csv_tables import Row, read_csv
from sim.scenario.environment import Trees
from sim.world.stem_map import read_stem_map
from tracking.errors import InputError, spell
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest
from tracking.management.scan_check import QUATERNION_TOLERANCE
from tracking.numerics.distances import length
from tracking.track import Scan

MEASUREMENT = ("x", "y", "xx", "xy", "yy")  # m, m²; empty in the row of a scan without measurements
POSE = ("camera_x", "camera_y", "camera_z", "camera_qx", "camera_qy", "camera_qz", "camera_qw")
SCAN_COLUMNS = ("time", "uav", *MEASUREMENT, *POSE)
CAMERA_COLUMNS = ("uav", "fov", "pixels")
TREE_COLUMNS = ("x", "y", "canopy_radius", "canopy_base", "canopy_top", "trunk_radius")
TREE_LEAVES = "leaf_area_density"  # one more column, if any canopy is porous; empty for those that are opaque

_LONGEST_GAP = 20.0  # s between scans: a person then walks out of most views

_Path = str | os.PathLike[str]


class _ScanRows(NamedTuple):
    """Rows of one UAV's scan."""

    pose: list[float]  # position and quaternion of the camera
    # Line of each measurement by its position and covariance; the key is empty if the scan has no measurement
    measurements: dict[tuple[float, ...], str]


def read_scans(path: _Path) -> Iterator[tuple[Scan, ...]]:
    """The scans of each instant by ascending UAV, from a CSV file with the columns `SCAN_COLUMNS` and any others.

    A row is one measurement: time [s], UAV, position [m], the entries of its covariance [m²], and the camera's pose
    with a quaternion xyzw. A scan without measurements is one row without x, y, xx, xy and yy, which is negative
    information for a tracker. Rows are in the order of time. InputError names file, line and column of a wrong entry,
    or a UAV whose camera never looks down, so that its quaternions may be in the order wxyz.
    """
    scans = list(_read_scans(path))
    for uav in sorted({scan.uav for instant in scans for scan in instant}):
        own = [scan for instant in scans for scan in instant if scan.uav == uav]
        if not any(_sees_ground(scan) for scan in own):
            where = f"scans: {path}, column camera_qx: the camera of UAV {uav}"
            hint = "quaternions are xyzw, 0,0,0,1 looks straight down; are these wxyz?"
            raise InputError(f"{where} looks above the horizon in each of its {len(own)} scans; {hint}")
    times = [instant[0].time for instant in scans]
    if len(times) > 1 and (usual := median(np.diff(times))) > _LONGEST_GAP:
        span = f"{len(times)} scans from {spell(times[0])} to {spell(times[-1])} s, {spell(usual, 3)} s apart"
        warnings.warn(f"scans: {path}, column time: {span}; are these milliseconds?", stacklevel=2)
    return iter(scans)


def _sees_ground(scan: Scan) -> bool:
    """Test if a camera looks down, or has a measurement in front of it although it looks up."""
    back, away = scan.pose.rotation[:, 2], scan.measurements - scan.pose.position[:2]
    depths = scan.pose.position[2] * back[2] - away[:, 0] * back[0] - away[:, 1] * back[1]
    return bool(back[2] >= 0 or (depths > 0).any())


def _read_scans(path: _Path) -> Iterator[tuple[Scan, ...]]:
    """As `read_scans`, without the check of cameras."""
    time = -math.inf
    scans = dict[int, _ScanRows]()
    for row in read_csv(Path(path), "scans", SCAN_COLUMNS):
        now = row.number("time")
        if now < time:
            raise row.error("time", f"{spell(now)} s comes after {spell(time)} s; times must not go backwards")
        if now > time:
            if scans:
                yield _make_scans(time, scans)
            time, scans = now, {}
        uav, pose = row.integer("uav"), _read_pose(row)
        scan = scans.setdefault(uav, _ScanRows(pose, {}))
        if pose != scan.pose:
            raise row.error("camera_x", "the camera has another pose in another row of this scan")
        measurement = _read_measurement(row, scan)
        if measurement in scan.measurements:
            raise row.error("x", f"the same measurement of this scan is in {scan.measurements[measurement]}")
        scan.measurements[measurement] = f"line {row.line}"
    if not scans:
        raise InputError(f"scans: {path}: holds no scan")
    yield _make_scans(time, scans)


def read_cameras(path: _Path) -> dict[int, Camera]:
    """The camera of each UAV, from a CSV file with the columns `CAMERA_COLUMNS`: full angle of view [rad], pixels."""
    cameras: dict[int, Camera] = {}
    for row in read_csv(Path(path), "cameras", CAMERA_COLUMNS):
        uav, fov, pixels = row.integer("uav"), row.number("fov"), row.integer("pixels")
        if uav in cameras:
            raise row.error("uav", f"UAV {uav} has a second row")
        try:
            cameras[uav] = Camera(fov, pixels)
        except ValueError as error:
            raise InputError(f"{row.where}, column {error}") from None
    return cameras


def read_forest(path: _Path) -> Forest:
    """The trees from a CSV file with the columns `TREE_COLUMNS`, all in m, or any other stem map."""
    return Forest(read_stem_map(Path(path), "trees", Trees(), least=0.0).trees)


def _read_pose(row: Row) -> list[float]:
    """Position and unit quaternion of the camera."""
    pose = [row.number(name) for name in POSE]
    norm = float(length(np.array(pose[3:])))
    if abs(norm - 1) > QUATERNION_TOLERANCE:
        raise row.error("camera_qx", f"the quaternion's norm is {norm:g}, not 1")
    return pose


def _read_measurement(row: Row, scan: _ScanRows) -> tuple[float, ...]:
    """Position and covariance, or nothing; InputError if the row contradicts earlier rows of its scan."""
    if () in scan.measurements:
        raise row.error("x", "this scan has another row, without a measurement")
    if not any(row.values[name] for name in MEASUREMENT):
        if scan.measurements:
            raise row.error("x", "is empty, but this scan has measurements")
        return ()
    x, y, xx, xy, yy = (row.number(name) for name in MEASUREMENT)
    if not (xx > 0 and xx * yy > xy * xy):
        raise row.error("xx", f"xx, xy, yy of {spell(xx)}, {spell(xy)}, {spell(yy)} m² are not positive definite")
    return x, y, xx, xy, xy, yy


def _make_scans(time: float, by_uav: dict[int, _ScanRows]) -> tuple[Scan, ...]:
    scans = []
    for uav, (pose, rows) in sorted(by_uav.items()):
        table = np.array(list(rows), dtype=float).reshape(-1, 6)
        at = Pose(np.array(pose[:3]), np.array(pose[3:]))
        scans.append(Scan(uav, time, at, table[:, :2].copy(), table[:, 2:].reshape(-1, 2, 2)))
    return tuple(scans)
