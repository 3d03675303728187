"""Trajectories of cameras as of the TUM and EuRoC data sets."""

from pathlib import Path

import numpy as np

from sim.exchange.values import DroneLog
from sim.scenario.text_files import read_text
from tracking.errors import InputError

_NUMBERS = 8  # of a pose


def read_trajectory(path: Path) -> DroneLog:
    """A trajectory: time, place, quaternion; TUM's has seconds and xyzw, EuRoC's nanoseconds, commas and wxyz."""
    where = f"log: {path}"
    lines = [line for line in read_text(path, "log").splitlines() if line.strip() and not line.lstrip().startswith("#")]
    euroc = "," in lines[-1] if lines else False
    rows = [line.replace(",", " ").split() for line in lines]
    rows = rows[1:] if rows and rows[0][0] == "timestamp" else rows
    if bad := next((n for n, row in enumerate(rows, 1) if len(row) < _NUMBERS), 0):
        raise InputError(f"{where}, pose {bad}: has {len(rows[bad - 1])} numbers; expected {_NUMBERS} or more")
    try:
        times = np.array([int(row[0]) / 1e9 if euroc else float(row[0]) for row in rows])
        values = np.array([[float(part) for part in row[1:_NUMBERS]] for row in rows])
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error
    order = np.argsort(times, kind="stable")
    places, turned = values[order, :3], values[order][:, [4, 5, 6, 3] if euroc else [3, 4, 5, 6]]
    return DroneLog(
        times[order], places[:, :2], places[:, 2], turned, "ground", on_map=False, axes="optical", epoch=0.0
    )
