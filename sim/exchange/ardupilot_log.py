"""Logs of ArduPilot, binary or as text, by pymavlink."""

import contextlib
import io
import math
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from sim.exchange.values import DroneLog, turn_at
from tracking.errors import InputError, one_line
from tracking.numerics.arrays import Array

_FIELDS = {
    "POS": ("Lat", "Lng", "RelHomeAlt"),
    "GPS": ("Lat", "Lng", "Alt"),
    "ATT": ("Yaw", "Pitch", "Roll"),
    "MNT": ("YawE", "Pitch", "Roll", "YawB"),
}
_YEARS = 1e8  # s, since 1970; clocks of logs without a fix are earlier


def read_ardupilot(path: Path) -> DroneLog:
    """A log of ArduPilot: POS or GPS for places, ATT for the body, MNT for a gimbal; InputError if it lacks them."""
    rows, epoch = _read_messages(path)
    above = "sea" if np.isnan(rows["POS"][:, 3]).all() else "start"
    times, latitudes, longitudes, heights = rows["POS" if above == "start" else "GPS"].T
    body, mount = rows["ATT"], rows["MNT"]
    if not len(times) or not len(body):
        raise InputError(f"log: {path}: has no messages POS or GPS, or no ATT; set LOG_BITMASK so that it has")
    attitudes = turn_at(times, body[:, 0], Rotation.from_euler("ZYX", body[:, 1:], degrees=True).as_quat())
    if len(mount):
        ahead = np.interp(mount[:, 0], body[:, 0], np.unwrap(body[:, 1], period=360))
        yaw = np.where(np.isnan(mount[:, 1]), mount[:, 4] + ahead, mount[:, 1])  # from north, or else from the body's
        parts = (np.unwrap(yaw, period=360), mount[:, 2], mount[:, 3])
        attitudes = np.column_stack([np.interp(times, mount[:, 0], part) for part in parts])
    return DroneLog(path, times, np.column_stack([latitudes, longitudes]), heights, attitudes, above, epoch=epoch)


def _read_messages(path: Path) -> tuple[dict[str, Array], float]:
    """Rows (N, 1 + fields) of each type of messages, by times [s] since the start; and when that was [s since 1970]."""
    try:
        from pymavlink.DFReader import DFReader_binary, DFReader_text
    except ImportError as error:
        raise InputError("log: a log of ArduPilot needs pymavlink: pip install pymavlink") from error
    found: dict[str, list[list[float]]] = {kind: [] for kind in _FIELDS}
    epoch = math.nan
    try:
        with path.open("rb") as file:
            binary = file.read(1) == b"\xa3"
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            reader = (DFReader_binary if binary else DFReader_text)(str(path))
            while message := reader.recv_match(type=list(_FIELDS)):
                own, kind = message.to_dict(), message.get_type()
                if own.get("I", 0):  # of a second receiver or gimbal
                    continue
                time = own["TimeUS"] / 1e6 if "TimeUS" in own else own["TimeMS"] / 1e3
                if math.isnan(epoch) and message._timestamp - time > _YEARS:
                    epoch = message._timestamp - time
                found[kind].append([time, *(float(own.get(name, math.nan)) for name in _FIELDS[kind])])
    except Exception as error:  # whatever a broken file makes of it
        raise InputError(f"log: {path}: is no log of ArduPilot that can be read: {one_line(error)}") from error
    return {kind: np.reshape(rows, (-1, 1 + len(_FIELDS[kind]))) for kind, rows in found.items()}, epoch
