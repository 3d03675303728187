"""Logs of PX4, by pyulog."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from sim.exchange.values import DroneLog
from sim.scenario.geo import Geo
from tracking.errors import InputError, one_line
from tracking.geometry.quaternions import interpolate_poses
from tracking.numerics.arrays import Array

_TOPICS = ("vehicle_local_position", "vehicle_global_position", "vehicle_attitude", "home_position")
_CLOCKS = ("vehicle_gps_position", "sensor_gps")
_GIMBALS = ("gimbal_device_attitude_status", "mount_orientation")
_EARTH = 16 | 64  # flags of a gimbal whose yaw is from north


def read_ulog(path: Path) -> DroneLog:
    """A ULog: places by the estimator, heights above its origin or home, attitudes of the body, or of a gimbal."""
    try:
        from pyulog import ULog
    except ImportError as error:
        raise InputError("log: a ULog needs pyulog: pip install 'understory[logs]'") from error
    try:
        log = ULog(str(path), [*_TOPICS, *_CLOCKS, *_GIMBALS])
    except Exception as error:  # whatever a broken file makes of it
        raise InputError(f"log: {path}: is no ULog that can be read: {one_line(error)}") from error
    found = {topic.name: topic.data for topic in reversed(log.data_list)}  # of several, the first counts
    local, attitude = found.get("vehicle_local_position"), found.get("vehicle_attitude")
    if local is None or attitude is None or not len(local["timestamp"]) or not len(attitude["timestamp"]):
        raise InputError(f"log: {path}: has no vehicle_local_position, or no vehicle_attitude; log both")
    times = _list_times(local)
    east, north = np.asarray(local["y"], dtype=float), np.asarray(local["x"], dtype=float)
    globe, on_map = found.get("vehicle_global_position"), True
    if globe is not None and len(globe["timestamp"]):
        places = np.column_stack([np.interp(times, _list_times(globe), globe[name]) for name in ("lat", "lon")])
        places[(times < _list_times(globe)[0]) | (times > _list_times(globe)[-1])] = math.nan
    elif (known := np.asarray(local["xy_global"]) > 0).any():
        n = int(known.argmax())
        origin = Geo(origin=(float(local["ref_lat"][n]), float(local["ref_lon"][n])))
        places = origin.find_degrees(np.column_stack([east, north]))
    else:
        places, on_map = np.column_stack([east, north]), False
    home = found.get("home_position")
    ground = float(home["z"][-1]) if home is not None and len(home["timestamp"]) else 0.0
    heights = ground - np.asarray(local["z"], dtype=float)
    turned, axes = _read_attitudes(found, times)
    return DroneLog(times, places, heights, turned, on_map=on_map, axes=axes, epoch=_find_epoch(found))


def _list_times(topic: dict[str, Any]) -> Array:
    return np.asarray(topic["timestamp"], dtype=float) / 1e6


def _read_attitudes(found: dict[str, Any], times: Array) -> tuple[Array, str]:
    """Attitudes (N, 3) deg of a gimbal at times (N,) s, or (N, 4) of the body or a gimbal; and their axes."""
    mount, device = found.get("mount_orientation"), found.get("gimbal_device_attitude_status")
    if mount is not None and len(mount["timestamp"]):
        angles = np.unwrap([mount[f"attitude_euler_angle[{n}]"] for n in (2, 1, 0)])
        return np.degrees(np.column_stack([np.interp(times, _list_times(mount), part) for part in angles])), ""
    body = _interpolate(found["vehicle_attitude"], times)
    if device is None or not len(device["timestamp"]):
        return body, "frd"
    own = _interpolate(device, times)
    if not int(device["device_flags"][0]) & _EARTH:  # turned by the yaw of the body
        x, y, z, w = body.T
        half = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) / 2
        c, s = np.cos(half), np.sin(half)
        x, y, z, w = own.T
        own = np.column_stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z])
    return own, "frd-ahead"


def _interpolate(topic: dict[str, Any], times: Array) -> Array:
    """Quaternions (N, 4) xyzw of a topic at times (N,) s."""
    own = _list_times(topic)
    turns = np.column_stack([np.zeros((len(own), 3)), *(topic[f"q[{n}]"] for n in (1, 2, 3, 0))])
    first = np.unique(own, return_index=True)[1]
    rows = interpolate_poses(own[first], turns[first], np.clip(times, own[0], own[-1]))[:, 3:]
    return np.asarray(rows)


def _find_epoch(found: dict[str, Any]) -> float:
    """Time since 1970 [s] of the log's zero; NaN without a fix."""
    for name in _CLOCKS:
        if name in found and len(fixed := np.flatnonzero(found[name]["time_utc_usec"])):
            topic, n = found[name], fixed[0]
            return (float(topic["time_utc_usec"][n]) - float(topic["timestamp"][n])) / 1e6
    return math.nan
