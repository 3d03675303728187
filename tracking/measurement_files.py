"""Scans, cameras and trees from CSV files, so that trackers run on measurements from other sources."""

import csv
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.management.validation import QUATERNION_TOLERANCE
from tracking.numerics.distances import length
from tracking.track import Scan

MEASUREMENT = ("x", "y", "xx", "xy", "yy")  # m, m²; empty in the row of a scan without measurements
POSE = ("camera_x", "camera_y", "camera_z", "camera_qx", "camera_qy", "camera_qz", "camera_qw")
SCAN_COLUMNS = ("time", "uav", *MEASUREMENT, *POSE)
CAMERA_COLUMNS = ("uav", "fov", "pixels")
TREE_COLUMNS = ("x", "y", "canopy_radius", "canopy_base", "canopy_top", "trunk_radius")
_DIGITS = 18  # most digits of an integer, so that it fits into 64 bits

_Path = str | os.PathLike[str]
_Scans = dict[int, tuple[tuple[float, ...], list[list[float]]]]  # by UAV: the camera's pose, and a list for each row


def read_scans(path: _Path) -> Iterator[tuple[Scan, ...]]:
    """The scans of each instant by ascending UAV, from a CSV file with the columns `SCAN_COLUMNS` and any others.

    A row is one measurement: time [s], UAV, position [m], the entries of its covariance [m²], and the camera's pose
    with a quaternion xyzw. A scan without measurements is one row without x, y, xx, xy and yy, which is negative
    information for a tracker. Rows are in the order of time. ValueError names file, line and column of a wrong entry.
    """
    time, scans = -math.inf, _Scans()
    for row in _rows(path, SCAN_COLUMNS):
        now = row.number("time")
        if now < time:
            raise row.wrong("time", f"{now:g} s comes after {time:g} s; times must not go backwards")
        if now > time:
            if scans:
                yield _scans(time, scans)
            time, scans = now, _Scans()
        uav, pose = row.integer("uav"), row.pose()
        first, rows = scans.setdefault(uav, (pose, []))
        if pose != first:
            raise row.wrong("camera_x", "the camera has another pose in another row of this scan")
        rows.append(row.measurement(rows))
    if not scans:
        raise ValueError(f"{path}: holds no scan")
    yield _scans(time, scans)


def read_cameras(path: _Path) -> dict[int, Camera]:
    """The camera of each UAV, from a CSV file with the columns `CAMERA_COLUMNS`: full angle of view [rad], pixels."""
    cameras: dict[int, Camera] = {}
    for row in _rows(path, CAMERA_COLUMNS):
        uav, fov, pixels = row.integer("uav"), row.number("fov"), row.integer("pixels")
        if uav in cameras:
            raise row.wrong("uav", f"UAV {uav} has a second row")
        try:
            cameras[uav] = Camera(fov, pixels)
        except ValueError as error:
            raise ValueError(f"{row.where}, column {error}") from None
    return cameras


def read_forest(path: _Path) -> Forest:
    """The trees from a CSV file with the columns `TREE_COLUMNS`, all in m."""
    return Forest(tuple(row.tree() for row in _rows(path, TREE_COLUMNS)))


@dataclass(frozen=True)
class _Row:
    """Line of a table, and its file and number."""

    where: str
    values: dict[str, str]

    def wrong(self, column: str, what: str) -> ValueError:
        return ValueError(f"{self.where}, column {column}: {what}")

    def number(self, column: str) -> float:
        """A finite number; ValueError names file, line and column."""
        text = self.values[column]
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.wrong(column, f"{text!r} is not a finite number" if text else "is empty")
        return value

    def integer(self, column: str) -> int:
        """An integer, 0 or more; ValueError names file, line and column."""
        text = self.values[column]
        if not (text.isascii() and text.isdigit()):
            raise self.wrong(column, f"{text!r} is not an integer, 0 or more" if text else "is empty")
        if len(text) > _DIGITS:
            raise self.wrong(column, f"an integer of {len(text)} digits; at most {_DIGITS} are allowed")
        return int(text)

    def tree(self) -> Tree:
        """A tree of possible sizes; ValueError names file, line and column."""
        tree = Tree(*(self.number(name) for name in TREE_COLUMNS))
        for name in ("canopy_radius", "canopy_base", "trunk_radius"):
            if (value := getattr(tree, name)) < 0:
                raise self.wrong(name, f"{value:g} m is not allowed; expected 0 or more")
        if tree.canopy_base > tree.canopy_top:
            raise self.wrong("canopy_base", f"{tree.canopy_base:g} m is above canopy_top {tree.canopy_top:g} m")
        return tree

    def pose(self) -> tuple[float, ...]:
        """Position and unit quaternion of the camera."""
        pose = tuple(self.number(name) for name in POSE)
        norm = float(length(np.array(pose[3:])))
        if abs(norm - 1) > QUATERNION_TOLERANCE:
            raise self.wrong("camera_qx", f"the quaternion's norm is {norm:g}, not 1")
        return pose

    def measurement(self, before: list[list[float]]) -> list[float]:
        """Position and covariance, or nothing; ValueError if the row contradicts earlier rows of its scan."""
        if before == [[]]:
            raise self.wrong("x", "this scan has another row, without a measurement")
        if not any(self.values[name] for name in MEASUREMENT):
            if before:
                raise self.wrong("x", "is empty, but this scan has measurements")
            return []
        x, y, xx, xy, yy = (self.number(name) for name in MEASUREMENT)
        if not (xx > 0 and xx * yy > xy * xy):
            raise self.wrong("xx", f"xx, xy, yy of {xx:g}, {xy:g}, {yy:g} m² are not positive definite")
        return [x, y, xx, xy, xy, yy]


def _scans(time: float, of_uavs: _Scans) -> tuple[Scan, ...]:
    scans = []
    for uav, (pose, rows) in sorted(of_uavs.items()):
        table = np.array(rows, dtype=float).reshape(-1, 6)
        at = Pose(np.array(pose[:3]), np.array(pose[3:]))
        scans.append(Scan(uav, time, at, table[:, :2].copy(), table[:, 2:].reshape(-1, 2, 2)))
    return tuple(scans)


def _rows(path: _Path, columns: Sequence[str]) -> Iterator[_Row]:
    """Lines of a CSV file with these columns; empty lines are skipped."""
    with Path(path).open(encoding="utf-8-sig", errors="surrogateescape", newline="") as file:
        lines = _lines(path, file)
        header = [name.strip() for name in next(lines, (1, []))[1]]
        for name in columns:
            if header.count(name) != 1:
                what = "twice" if name in header else "missing"
                raise ValueError(f"{path}, line 1: column {name} is {what}; columns are {','.join(header) or 'none'}")
        for number, fields in lines:
            where = f"{path}, line {number}"
            if fields and len(fields) != len(header):
                raise ValueError(f"{where}: has {len(fields)} fields, not {len(header)} as line 1")
            if fields:
                yield _Row(where, dict(zip(header, map(str.strip, fields), strict=True)))


def _lines(path: _Path, file: Iterable[str]) -> Iterator[tuple[int, list[str]]]:
    """Number and fields of each line; ValueError names a line that is not UTF-8 or not CSV."""
    table = csv.reader(file)
    try:
        for fields in table:
            for text in fields:
                if not text.isascii() and any("\udc80" <= letter <= "\udcff" for letter in text):
                    raise ValueError(f"{path}, line {table.line_num}: {text[:40]!a} is not UTF-8")
            yield table.line_num, fields
    except csv.Error as error:
        raise ValueError(f"{path}, line {table.line_num}: {error}") from error
