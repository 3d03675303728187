"""What in the files of a flight is not used, or far from any drone, and the axes of its quaternions."""

import math
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.csv_files import ANGLES, KNOWN, QUATERNION
from sim.exchange.values import LoggedUav, PoseLog
from sim.scenario.csv_tables import read_csv
from sim.scenario.geo import Geo
from tracking.errors import check_known, list_numbers, spell
from tracking.numerics.arrays import Array

# Rotations by which attitudes become those of images: of the world before them, and of the axes behind them.
_AXES = {
    "image": (np.eye(3), np.eye(3)),  # x right, y up, z away from what is seen
    "optical": (np.eye(3), np.diag([1.0, -1.0, -1.0])),  # x right, y down, z ahead, as of ROS, COLMAP and TUM
    "flu": (np.eye(3), np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])),  # body: x ahead, y left, z up
    "frd": (np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])),
}  # frd: body of PX4 to north-east-down; cameras of bodies look down, ahead is at the top of images
_WORDS = {
    "optical": "of optical axes, z ahead",
    "flu": "of a body with x ahead",
    "frd": "of a body with x ahead and z down, as PX4 logs them",
}
_ATTITUDE = r"(?i)head|yaw|pitch|roll|course|azimuth|omega|kappa|q[wxyz]|quat"  # parts of names of columns
_SMALLEST = 0.02  # m, extent of a flight
_FASTEST = 60.0  # m/s, in the median of a drone that moves
_SLOWEST = 1e-3  # m/s, at the most, of what moves by more than `_SMALLEST`
_HIGHEST = 300.0  # m above ground, in the median
_FARTHEST = 1000.0  # m, from a camera to its detections in the median
_BELOW = 1e-3  # heights, from a camera to its detections in the median
_DEGREES = "in degrees? expected metres, such as eastings and northings"
_LEVEL, _NORTH = np.sin(np.radians([1.6, 6.4])).tolist()  # of what radians taken for degrees reach
_EXACT = 1e-6  # sine of an angle that is zero but for rounding
_STEP = 0.5  # s, over which velocities are measured
_SLOW = 1.0  # m/s, below which a drone does not show where ahead is
_NORTH_UP = 0.995
_MANY = 10  # velocities that show it


class Doubt(NamedTuple):
    """What is odd about a UAV."""

    uav: int
    found: str
    hint: str  # what it may mean, or what mends it; empty if nothing is known


def tell_doubts(doubts: Iterable[Doubt]) -> Iterator[str]:
    """A remark for each hint, with what is found of its first UAV, and the numbers of the others."""
    by_hint = defaultdict[str, list[Doubt]](list)
    for doubt in doubts:
        by_hint[doubt.hint].append(doubt)
    for hint, (first, *more) in by_hint.items():
        others = sorted({doubt.uav for doubt in more} - {first.uav})
        likewise = f" ({list_numbers('UAV', others)} likewise)" if others else ""
        yield "; ".join(filter(None, (f"{first.found}{likewise}", hint)))


def turn(attitudes: Array, axes: str) -> Array:
    """Quaternions (P, 4) of images, from those of other `axes`; InputError if these are unknown."""
    if axes in ("", "image"):
        return attitudes
    check_known("cameras: column axes", axes, _AXES)
    world, own = (Rotation.from_matrix(part) for part in _AXES[axes])
    return np.asarray((world * Rotation.from_quat(attitudes) * own).as_quat())


def name_axes(attitudes: Array, axes: str) -> str:
    """What quaternions (P, 4) may mean that look above the horizon as they are, if they look down in other axes.

    axes: in which they were read; empty if the file has other attitudes.
    """
    found = list[str]()
    if not axes:
        return ""
    if _share_down(turn(attitudes, "optical")) > 0.9:
        found.append(f'{_WORDS["optical"]} (then cameras.csv has a column axes with "optical")')
    if _share_down(np.roll(attitudes, -1, axis=1)) > 0.9:
        found.append("wxyz")
    return f"are these {', or '.join(found)}?" if found else ""


def _share_down(attitudes: Array) -> float:
    """Share of attitudes of images that look below the horizon."""
    return float((Rotation.from_quat(attitudes).apply([0.0, 0.0, 1.0])[:, 2] > 0).mean())


def find_doubts(folder: Path, uavs: Sequence[LoggedUav], geo: Geo) -> Iterator[str]:
    """Remarks on columns of files that are not used, and on places, speeds and attitudes that no drone has."""
    for name, known in KNOWN.items():
        if (folder / f"{name}.csv").exists():
            yield from _list_unused(folder / f"{name}.csv", name, known, geo)
    degrees = _are_degrees(np.vstack([uav.poses.rows[:, :2] for uav in uavs]))
    if degrees:
        yield f"poses: all places are within {_SMALLEST:g} m; are x_m and y_m {_DEGREES}"
    if _are_degrees(np.vstack([_list_places(uav) for uav in uavs])):
        yield f"detections: all places are within {_SMALLEST:g} m; are x_m and y_m {_DEGREES}"
    yield from tell_doubts(doubt for i, uav in enumerate(uavs) for doubt in _doubt_uav(uav, i, degrees=degrees))


def _doubt_uav(uav: LoggedUav, number: int, *, degrees: bool) -> Iterator[Doubt]:
    """Doubts about a UAV of this number; degrees: True if all places may be in degrees."""
    height = float(np.median(uav.poses.rows[:, 2]))
    if height > _HIGHEST:
        high = f"poses: UAV {number} is {spell(height, 3)} m high in the median"
        yield Doubt(number, high, "are heights in metres above the ground, not the sea?")
    if not degrees:
        yield from _doubt_distances(_measure_distances(uav), number, height)
    for name, value in {**uav.camera.view, **uav.camera.view.get("camera", {})}.items():
        if name.endswith("fov_deg") and value and value < math.pi:
            yield Doubt(number, f"cameras: {name} of UAV {number} is {spell(value, 3)}", "is it in degrees?")
    yield from _doubt_motion(uav.poses, number, uav.camera.axes)


def _list_unused(path: Path, name: str, known: Mapping[str, str], geo: Geo) -> Iterator[str]:
    """Remarks on the columns of a file that are not used, and on times without a zone."""
    row = next(read_csv(path, name, (), spares=known, geo=geo), None)
    if row is None:
        return
    if row.lacks_zone("time_s"):
        yield f"{name}: times have no zone, and are taken to be of UTC"
    angles = name == "poses" and any(column in row.values for column in ANGLES)
    unused = [own for own in row.values if own and (own not in known.values() or (angles and own in QUATERNION))]
    if unused:
        names = f"; attitudes have the columns {','.join(QUATERNION)}, or {','.join(ANGLES)}"
        turns = not angles and any(re.search(_ATTITUDE, own) for own in unused)
        yield f"{name}: not used: column{'s' * (len(unused) > 1)} {', '.join(unused)}{names if turns else ''}"
    for column, meaning in zip(ANGLES, ("north is at the top of images", "cameras look straight down"), strict=False):
        if angles and column not in row.values:
            yield f"{name}: without the column {column}, {meaning}"


def _are_degrees(places: Array) -> bool:
    """True for places (N, 2) that differ, but hardly."""
    places = places[~np.isnan(places[:, 0])]
    return len(np.unique(places, axis=0)) > 2 and bool((np.ptp(places, axis=0) < _SMALLEST).all())


def _list_places(uav: LoggedUav) -> Array:
    return np.array([found.place for frame in uav.frames for found in frame.detections]).reshape(-1, 2)


def _measure_distances(uav: LoggedUav) -> Array:
    """Horizontal distances [m] of detections on the ground from the camera."""
    times = np.array([frame.time for frame in uav.frames for _ in frame.detections])
    if not len(times):
        return times
    distances = np.hypot(*(_list_places(uav) - uav.poses.at(times)[:, :2]).T)
    return np.asarray(distances[~np.isnan(distances)])


def _doubt_distances(distances: Array, uav: int, height: float) -> Iterator[Doubt]:
    """A doubt about distances (N,) m of detections on the ground from a UAV at this height [m], in the median."""
    usual = float(np.median(distances)) if len(distances) else height
    if usual > max(_FARTHEST, 20 * height):
        away = f"those of UAV {uav} are {spell(usual, 3)} m away from it in the median"
        yield Doubt(uav, f"detections: {away}", "do their places have the unit and the origin of poses?")
    elif len(distances) >= _MANY and usual < _BELOW * height:
        away = f"those of UAV {uav} are {spell(usual, 2)} m from the place below it in the median"
        yield Doubt(uav, f"detections: {away}", "are places in metres?")


def _doubt_motion(log: PoseLog, uav: int, axes: str) -> Iterator[Doubt]:
    """Doubts about the speed of a UAV, and on attitudes that do not fit to where it flies; axes: as of `name_axes`."""
    gaps = np.diff(log.times)
    steps = np.hypot(*np.diff(log.rows[:, :2], axis=0).T)
    speeds = steps[steps > 0] / gaps[steps > 0]
    moves = len(speeds) > 2 and float(np.ptp(log.rows[:, :2], axis=0).max()) >= _SMALLEST
    if moves and (np.median(speeds) > _FASTEST or speeds.max() < _SLOWEST):
        flies = f"UAV {uav} flies at {spell(float(np.median(speeds)), 3)} m/s in the median"
        yield Doubt(uav, f"poses: {flies}", "are places in metres and times in seconds?")
        return
    east, north, up = Rotation.from_quat(log.rows[:, 3:]).apply([0.0, 0.0, -1.0]).T
    north_ahead = (np.abs(up) < _LEVEL).all() and (np.abs(east) < _NORTH).all() and (north > 0).all()
    if north_ahead and np.abs(up).max() > _EXACT:
        looks = f"the camera of UAV {uav} always looks at the horizon in the north"
        yield Doubt(uav, f"poses: {looks}", f"are {', '.join(ANGLES)} in degrees?")
        return
    down = _share_down(log.rows[:, 3:])
    if 0 < down < 0.9:
        share = f"the camera of UAV {uav} looks above the horizon in {100 * (1 - down):.0f} % of its poses"
        yield Doubt(uav, f"poses: {share}", name_axes(log.rows[:, 3:], axes))
        return
    ahead = _find_axes_ahead(log) if axes else ""
    if ahead:
        flies = f"poses: UAV {uav} flies as if its quaternions were {_WORDS[ahead]}"
        yield Doubt(uav, flies, f'if they are, give cameras.csv a column axes with "{ahead}"')


def _find_axes_ahead(log: PoseLog) -> str:
    """Axes in which a UAV flies ahead while its camera looks down, if it does not as poses are read; else empty."""
    times = np.arange(log.times[0], log.times[-1] - _STEP, _STEP)
    velocities = (log.at(times + _STEP)[:, :2] - log.at(times)[:, :2]) / _STEP
    speeds = np.hypot(*velocities.T)
    moving = speeds > _SLOW
    if moving.sum() < _MANY:
        return ""
    course = velocities[moving] / speeds[moving, None]
    attitudes = log.at(times + _STEP / 2)[moving, 3:]
    if not _looks_down(attitudes):  # as of a UAV that circles what it sees
        return ""
    top = Rotation.from_quat(attitudes).apply([0.0, 1.0, 0.0])
    if (top[:, 1] > _NORTH_UP).all():  # of a gimbal that keeps north at the top
        return ""
    turns = np.hypot(*course.mean(axis=0)) < 0.85
    own = _measure_agreement(attitudes, course)
    found = {axes: _measure_agreement(turn(attitudes, axes), course) for axes in ("flu", "frd")}
    best = max(found, key=lambda axes: found[axes])
    return best if own < 0.5 and found[best] > (0.9 if turns else 0.97) else ""


def _looks_down(attitudes: Array) -> bool:
    return bool((Rotation.from_quat(attitudes).apply([0.0, 0.0, 1.0])[:, 2] > 0.8).all())


def _measure_agreement(attitudes: Array, course: Array) -> float:
    """Mean cosine between the top of images and the course (N, 2); -1 if images do not look down."""
    if not _looks_down(attitudes):
        return -1.0
    top = Rotation.from_quat(attitudes).apply([0.0, 1.0, 0.0])[:, :2]
    return float(((top * course).sum(axis=1) / np.hypot(*top.T)).mean())
