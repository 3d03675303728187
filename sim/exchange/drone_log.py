"""Logs of drones, told by their content, and the poses of cameras from them."""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.air_data import read_air_data
from sim.exchange.ardupilot_log import read_ardupilot
from sim.exchange.dji_srt import read_srt
from sim.exchange.flight_doubts import turn
from sim.exchange.px4_log import read_ulog
from sim.exchange.trajectory_log import read_trajectory
from sim.exchange.values import DroneLog, LoggedCamera, PoseLog, find_attitudes
from sim.scenario.geo import FARTHEST, Geo
from tracking.errors import InputError, spell
from tracking.numerics.arrays import Array

_HEAD = 4096  # bytes, by which a format is told
_LEAST = 4  # points of a trajectory without a header
_NUMBERS = rb"(?:[-+.\deE]+[ \t]+){7}[-+.\deE]+[ \t]*\r?\n"
_READERS: dict[str, tuple[bytes, Callable[[Path], DroneLog]]] = {
    "DJI SRT": (rb"(\xef\xbb\xbf)?\s*\d+\s*\n(\d+:\d\d:\d\d[,.]\d+ *-->|\d{4}[-.]\d)", read_srt),
    "AirData CSV": (rb"(?i)[^\n]*(time\(millisecond\)|height_above_takeoff)", read_air_data),
    "ULog of PX4": (rb"ULog\x01\x12\x35", read_ulog),
    "log of ArduPilot": (rb"\xa3\x95|(?s:.*)\bFMT, ?128, ?89, ?FMT", read_ardupilot),
    "EuRoC trajectory": (rb"#? ?timestamp[^\n]*p_RS_R_x", read_trajectory),
    "TUM trajectory": (rb"(#[^\n]*\n)*(%s){%d}" % (_NUMBERS, _LEAST), read_trajectory),
}
# Files that are told, but not read, and what to give in their place.
_REFUSED = {
    rb"[^\n]*OSD\.(latitude|flyTime)": ("DJI's flight record as CSV", "AirData's CSV of the same flight"),
    rb"(?s).{16}BUILD": ("DJI's DAT log", "the video's SRT, or AirData's CSV of the flight"),
    rb"(?s)\s*<.*<kml": ("KML", "the log itself, or its GPX as truth.gpx if it is of people"),
    rb"# Image list with two lines": ("COLMAP's images.txt", 'poses.csv, with "optical" axes in cameras.csv'),
    rb"# Camera list with one line": ("COLMAP's cameras.txt", "cameras.csv"),
}
_PLAIN = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".toml", ".yaml", ".yml", ".json", ".mp4", ".mov", ".npz", ".md"}
_OWN = {f"{name}.csv" for name in ("poses", "detections", "cameras", "trees", "truth", "tracks", "images")}


class FoundLog(NamedTuple):
    """A log of a flight, and where it was found."""

    path: Path
    format: str
    log: DroneLog


def find_logs(folder: Path) -> dict[int, FoundLog]:
    """The logs in a folder by UAV, by names such as uav1.SRT, else in order of names; InputError for unread ones."""
    found = []
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if path.is_file() and path.name not in _OWN and path.suffix.lower() not in _PLAIN:
            with path.open("rb") as file:
                head = file.read(_HEAD)
            name = next((name for name, (first, _) in _READERS.items() if re.match(first, head)), "")
            if name:
                found.append(FoundLog(path, name, _READERS[name][1](path)))
                continue
            if path.suffix.lower() == ".tlog":
                raise InputError(f"FLIGHT: {path} is of a ground station, which is not read; give the drone's own log")
            for first, (what, instead) in _REFUSED.items():
                if re.match(first, head):
                    raise InputError(f"FLIGHT: {path} is {what}, which is not read; give {instead}")
    own = {one.path: one for one in found}
    return {i: own[path] for i, path in number_files(own).items()}


def number_files(paths: Iterable[Path]) -> dict[int, Path]:
    """Files by UAV: numbered ones such as uav1.SRT by their numbers, others by their order."""
    found: dict[int, Path] = {}
    for i, path in enumerate(paths):
        number = re.search(r"(?i)uav_?(\d+)", path.stem)
        uav = int(number[1]) if number else i
        if uav in found:
            raise InputError(f"FLIGHT: {path} and {found[uav].name} are both of UAV {uav}; expected one of them")
        found[uav] = path
    return found


def make_poses(found: FoundLog, camera: LoggedCamera, geo: Geo, *, since_1970: bool) -> tuple[PoseLog, list[str]]:
    """Poses of the camera of a log, and remarks on what is taken for granted; InputError says what it lacks.

    since_1970: True if the times of frames are.
    """
    path, log = found.path, found.log
    where = f"log: {path}"
    fixed = np.isfinite(log.places).all(axis=1) & ((log.places != 0).any(axis=1) | (not log.on_map))
    heights, remarks = _find_heights(log, camera.given, geo, where)
    quaternions, told = _find_attitudes(log, camera, where)
    remarks += told
    kept = fixed & np.isfinite(heights) & np.isfinite(quaternions).all(axis=1)
    kept[np.flatnonzero(kept)[1:]] = np.diff(log.times[kept]) > 0
    if not kept.any():
        raise InputError(f"{where}: has no place with a time and a height")
    if lost := int((~kept).sum()):
        remarks.append(f"{where}: left out: {lost} of {len(kept)} rows, without a place or a time of their own")
    times, offset = log.times[kept], camera.given.get("pose_offset_s", 0.0)
    if since_1970 and math.isnan(log.epoch):
        raise InputError(f"{where}: tells no date; count the times of frames from its start")
    if since_1970:
        offset += log.epoch
    elif log.film:
        offset -= log.film[0]
        remarks.append(f"{where}: its video begins at {spell(log.film[0])} s; times of frames count from there")
    places = _find_places(log.places[kept], geo, where) if log.on_map else log.places[kept]
    rows = np.column_stack([places, heights[kept], quaternions[kept]])
    what = f"{where}: {found.format}, {len(times)} poses from {spell(times[0])} to {spell(times[-1])} s"
    return PoseLog(times + offset, rows), [what, *log.remarks, *remarks]


def _find_places(places: Array, geo: Geo, where: str) -> Array:
    metres = geo.find_metres(*places.T)
    far = np.abs(metres).max(axis=1)
    if np.abs(places[:, 0]).max() > 90 or far.max() > FARTHEST:
        try:
            geo.place(*places[far.argmax()].tolist())
        except ValueError as error:
            raise InputError(f"{where}: {error}") from error
    return metres


def _find_heights(log: DroneLog, given: Mapping[str, float], geo: Geo, where: str) -> tuple[Array, list[str]]:
    """Heights (N,) m above the ground, and what is taken for granted."""
    if "height_m" in given:
        return np.full(len(log.times), given["height_m"]), []
    if np.isnan(log.heights).all():
        raise InputError(f"{where}: has no heights; give cameras.csv a column height_m, above the ground")
    if log.above == "start":
        level = "heights are above the start, which is taken to be on the level of all ground"
        return log.heights, [f"{where}: {level}"]
    if log.above == "ground":
        return log.heights, [f"{where}: heights are taken to be above the ground"]
    if geo.ground is None:
        usual = spell(float(np.nanmedian(log.heights)), 4)
        least = spell(float(np.nanmin(log.heights)), 4)
        asked = f"--set geo.ground=G, of the ground above the sea; they are {usual} m in the median, {least} m at least"
        raise InputError(f"{where}: has no heights above the start, but above the sea; give {asked}")
    return log.heights - geo.ground, [f"{where}: heights are above the sea, and the ground is at {geo.ground:g} m"]


def _find_attitudes(log: DroneLog, camera: LoggedCamera, where: str) -> tuple[Array, list[str]]:
    """Attitudes (N, 4) of images, and what is taken for granted; angles in `cameras.csv` count first."""
    given = camera.given
    angles, told = log.attitudes, list[str]()
    if angles.shape[1] == 4:
        axes = log.axes if camera.axes == "image" else camera.axes
        quaternions = turn(angles, axes)
        if "pitch_deg" not in given:
            looks = {"frd": "the camera is taken to look down from the body", "optical": "axes are optical, z ahead"}
            hint = "; pitch_deg and axes in cameras.csv change it" * (camera.axes == "image")
            return quaternions, [f"{where}: {looks[axes]}{hint}"] if axes in looks else []
        east, north, _ = Rotation.from_quat(quaternions).apply([0.0, 1.0, 0.0]).T
        angles = np.column_stack([np.degrees(np.arctan2(east, north)), np.full((len(east), 2), np.nan)])
    columns = [given.get(name, math.nan) for name in ("yaw_deg", "pitch_deg", "roll_deg")]
    angles = np.where(np.isnan(columns), angles, columns)
    lacking = [name for name, values in zip(("yaw_deg", "pitch_deg"), angles.T, strict=False) if np.isnan(values).all()]
    if lacking:
        meant = "yaw clockwise from north, pitch -90 straight down"
        asked = f"give cameras.csv the column{'s' * (len(lacking) > 1)} {' and '.join(lacking)} ({meant})"
        raise InputError(f"{where}: has no angles of a gimbal; {asked}, or poses in poses.csv")
    angles[:, 2] = np.nan_to_num(angles[:, 2])
    return find_attitudes(angles), told
