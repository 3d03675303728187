"""Logs of ArduPilot, binary or as text, by pymavlink."""

import contextlib
import io
import math
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.values import DroneLog
from tracking.errors import InputError, one_line
from tracking.geometry.quaternions import interpolate_poses
from tracking.numerics.arrays import Array

_FIELDS = {
    "POS": ("Lat", "Lng", "RelHomeAlt"),
    "ATT": ("Roll", "Pitch", "Yaw"),
    "MNT": ("Roll", "Pitch", "YawE", "YawB"),
    "GPS": ("Lat", "Lng", "Alt"),
}
_YEARS = 1e8  # s, since 1970; clocks of logs without a fix are earlier


def read_ardupilot(path: Path) -> DroneLog:
    """A log of ArduPilot: POS or GPS for places, ATT for the body, MNT for a gimbal; InputError if it lacks them."""
    rows, epoch = _read_messages(path)
    of_places = rows["POS"] if len(rows["POS"]) and not np.isnan(rows["POS"][:, 3]).all() else rows["GPS"]
    if not len(of_places) or not len(rows["ATT"]):
        raise InputError(f"log: {path}: has no messages POS or GPS, or no ATT; set LOG_BITMASK so that it has")
    above = "start" if of_places is rows["POS"] else "sea"
    times = of_places[:, 0]
    attitudes = _find_gimbal(rows, times) if len(rows["MNT"]) else _turn(rows["ATT"], times)
    return DroneLog(times, of_places[:, 1:3], of_places[:, 3], attitudes, above, axes="frd", epoch=epoch)


def _read_messages(path: Path) -> tuple[dict[str, Array], float]:
    """Rows (N, 1 + fields) of each type of messages, by times [s] since the start; and when that was [s since 1970]."""
    try:
        from pymavlink.DFReader import DFReader_binary, DFReader_text
    except ImportError as error:
        raise InputError("log: a log of ArduPilot needs pymavlink: pip install 'understory[logs]'") from error
    found: defaultdict[str, list[list[float]]] = defaultdict(list)
    epoch = math.nan
    try:
        with path.open("rb") as file:
            binary = file.read(1) == b"\xa3"
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            reader = (DFReader_binary if binary else DFReader_text)(str(path))
            while message := reader.recv_match(type=list(_FIELDS)):
                own = message.to_dict()
                if own.get("I", 0):  # of a second receiver or gimbal
                    continue
                time = own["TimeUS"] / 1e6 if "TimeUS" in own else own["TimeMS"] / 1e3
                if math.isnan(epoch) and message._timestamp - time > _YEARS:
                    epoch = message._timestamp - time
                kind = message.get_type()
                found[kind].append([time, *(float(own.get(name, math.nan)) for name in _FIELDS[kind])])
    except Exception as error:  # whatever a broken file makes of it
        raise InputError(f"log: {path}: is no log of ArduPilot that can be read: {one_line(error)}") from error
    empty = {kind: np.zeros((0, 1 + len(names))) for kind, names in _FIELDS.items()}
    return empty | {kind: np.array(rows) for kind, rows in found.items()}, epoch


def _turn(rows: Array, times: Array) -> Array:
    """Quaternions (N, 4) of the body at times (N,) s."""
    own, first = np.unique(rows[:, 0], return_index=True)
    turns = Rotation.from_euler("ZYX", rows[first][:, [3, 2, 1]], degrees=True).as_quat()
    poses = np.hstack([np.zeros((len(own), 3)), turns])
    return np.asarray(interpolate_poses(own, poses, np.clip(times, own[0], own[-1]))[:, 3:])


def _find_gimbal(rows: dict[str, Array], times: Array) -> Array:
    """Yaw, pitch and roll (N, 3) deg of the gimbal at times (N,) s; yaw from north, or else from the body's."""
    mount, body = rows["MNT"], rows["ATT"]
    ahead = np.interp(mount[:, 0], body[:, 0], np.unwrap(body[:, 3], period=360))
    yaw = np.where(np.isnan(mount[:, 3]), mount[:, 4] + ahead, mount[:, 3])
    parts = (np.unwrap(yaw, period=360), mount[:, 2], mount[:, 1])
    return np.column_stack([np.interp(times, mount[:, 0], part) for part in parts])
