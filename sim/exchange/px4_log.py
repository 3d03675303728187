"""Logs of PX4, by pyulog."""

import contextlib
import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from sim.exchange.values import DroneLog, turn_at
from sim.scenario.geo import Geo
from tracking.errors import InputError, one_line
from tracking.numerics.arrays import Array

_POSITION, _GLOBAL, _BODY = "vehicle_local_position", "vehicle_global_position", "vehicle_attitude"
_HOME, _CLOCKS = "home_position", ("vehicle_gps_position", "sensor_gps")


def read_ulog(path: Path) -> DroneLog:
    """A ULog: places by the estimator, heights above its origin or home, attitudes of the body."""
    try:
        from pyulog import ULog
    except ImportError as error:
        raise InputError("log: a ULog needs pyulog: pip install pyulog") from error
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(str(path), [_POSITION, _GLOBAL, _BODY, _HOME, *_CLOCKS])
    except Exception as error:  # whatever a broken file makes of it
        raise InputError(f"log: {path}: is no ULog that can be read: {one_line(error)}") from error
    # Of several topics of a name, the first counts.
    found = {topic.name: topic.data for topic in reversed(log.data_list) if len(topic.data["timestamp"])}
    if not {_POSITION, _BODY} <= {*found}:
        raise InputError(f"log: {path}: has no {_POSITION}, or no {_BODY}; log both")
    local, times = found[_POSITION], _list_times(found[_POSITION])
    places, on_map = np.column_stack([local["y"], local["x"]]).astype(float), True
    if globe := found.get(_GLOBAL):
        own = _list_times(globe)
        places = np.column_stack([np.interp(times, own, globe[name]) for name in ("lat", "lon")])
        places[(times < own[0]) | (times > own[-1])] = math.nan
    elif on_map := bool((known := np.asarray(local["xy_global"]) > 0).any()):
        n = int(known.argmax())
        places = Geo(origin=(float(local["ref_lat"][n]), float(local["ref_lon"][n]))).find_degrees(places)
    ground = float(found[_HOME]["z"][-1]) if _HOME in found else 0.0
    fixes = [(topic["time_utc_usec"], topic["timestamp"]) for name in _CLOCKS if (topic := found.get(name))]
    epochs = [(float(utc[n]) - float(own[n])) / 1e6 for utc, own in fixes for n in np.flatnonzero(utc)[:1]]
    body = found[_BODY]
    turned = turn_at(times, _list_times(body), np.column_stack([body[f"q[{n}]"] for n in (1, 2, 3, 0)]))
    heights, epoch = ground - np.asarray(local["z"], dtype=float), epochs[0] if epochs else math.nan
    return DroneLog(path, times, places, heights, turned, on_map=on_map, axes="frd", epoch=epoch)


def _list_times(topic: dict[str, Any]) -> Array:
    return np.asarray(topic["timestamp"], dtype=float) / 1e6
