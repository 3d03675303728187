"""Flights as CSV by AirData, in feet and miles unless its user asked for metres."""

import math
from pathlib import Path

import numpy as np

from sim.exchange.values import DroneLog
from sim.scenario.csv_tables import TableRow, read_csv
from tracking.errors import InputError
from tracking.numerics.arrays import Array

_METRES = {"feet": 0.3048, "ft": 0.3048, "meters": 1.0, "metres": 1.0, "m": 1.0}
_HEIGHTS = {"height_above_takeoff": "start", "altitude_above_sealevel": "sea"}
_PLAIN = ("latitude", "longitude", "time_millisecond", "datetime_utc", "isvideo", *_HEIGHTS)
_ANGLES = ("gimbal_heading_degrees", "gimbal_pitch_degrees", "gimbal_roll_degrees", "compass_heading_degrees")
_COLUMNS = {name: name for name in (*_PLAIN, *_ANGLES, *(f"{name}_{unit}" for name in _HEIGHTS for unit in _METRES))}


def read_air_data(path: Path) -> DroneLog:
    """AirData's log: heights are in the unit that the names of their columns have; InputError if there is none."""
    rows = list(read_csv(path, "log", ("latitude", "longitude", "time_millisecond"), spares=_COLUMNS))
    if not rows:
        raise InputError(f"log: {path}: has no rows")
    heights, above = _read_heights(rows, path)
    yaw, pitch, roll, compass = (_read(rows, name) for name in _ANGLES)
    remarks = []
    if np.isnan(yaw).all():
        yaw = compass
        remarks += [f"log: {path}: the gimbal is taken to look where the compass does"] * (not np.isnan(yaw).all())
    times = _read(rows, "time_millisecond") / 1000
    epoch = math.nan
    if stamped := [n for n, row in enumerate(rows) if row.values.get("datetime_utc")]:
        # Dates have whole seconds, and begin within the row that has a new one.
        stamps = np.array([rows[n].time("datetime_utc") for n in stamped])
        epoch = float((stamps - times[stamped]).max())
    filmed = times[_read(rows, "isvideo") > 0]
    return DroneLog(
        path=path,
        times=times,
        places=np.column_stack([_read(rows, "latitude"), _read(rows, "longitude")]),
        heights=heights,
        attitudes=np.column_stack([yaw, pitch, roll]),
        above=above,
        epoch=epoch,
        film=(float(filmed[0]), float(filmed[-1])) if len(filmed) else None,
        remarks=tuple(remarks),
    )


def _read(rows: list[TableRow], column: str) -> Array:
    """Numbers (N,) of a column; NaN where there is none."""
    found = (row.optional_number(column) for row in rows)
    return np.array([math.nan if value is None else value for value in found])


def _read_heights(rows: list[TableRow], path: Path) -> tuple[Array, str]:
    """Heights (N,) m, and what they are above."""
    for name, above in _HEIGHTS.items():
        for unit, metres in _METRES.items():
            if f"{name}_{unit}" in rows[0].values:
                return _read(rows, f"{name}_{unit}") * metres, above
        if name in rows[0].values:
            raise InputError(f"log: {path}, column {name}: tells no unit; call it {name}(feet) or {name}(meters)")
    return np.full(len(rows), math.nan), "start"
