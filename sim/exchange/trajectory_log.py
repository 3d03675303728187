"""Trajectories of cameras as of the TUM and EuRoC data sets."""

import io
from pathlib import Path

import numpy as np

from sim.exchange.values import DroneLog
from sim.scenario.text_files import read_text
from tracking.errors import InputError, one_line


def read_trajectory(path: Path) -> DroneLog:
    """A trajectory of times, places and quaternions: TUM's of seconds and xyzw, EuRoC's of nanoseconds and wxyz."""
    text = read_text(path, "log").removeprefix("timestamp")
    euroc = "p_RS_R_x" in text
    try:
        rows = np.loadtxt(io.StringIO(text.replace("[ns]", "#", 1)), delimiter="," if euroc else None, usecols=range(8))
    except ValueError as error:
        raise InputError(f"log: {path}: {one_line(error)}") from error
    rows = np.atleast_2d(rows)[np.argsort(np.atleast_2d(rows)[:, 0], kind="stable")]
    times, turned = (rows[:, 0] / 1e9, rows[:, [5, 6, 7, 4]]) if euroc else (rows[:, 0], rows[:, 4:])
    return DroneLog(path, times, rows[:, 1:3], rows[:, 3], turned, "ground", on_map=False, axes="optical", epoch=0.0)
