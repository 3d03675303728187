"""Tables of a recording: CSV files for the readers of Stone Soup, and Parquet files."""

from pathlib import Path

import numpy as np

from sim.exchange.csv_files import write_table
from sim.exchange.values import STATE, TRACK, list_measurements, list_rows, list_tracks, list_truth
from sim.facts.columns import TABLES, make_dataframe
from sim.facts.flight import Flight
from sim.mission.recording import Recording
from tracking.errors import InputError

_MEASUREMENT = ("time", "x", "y", "xx", "xy", "yy")
_TRACK = tuple(name for name in TRACK if name != "uav")


def write_stonesoup(recording: Recording, folder: Path) -> None:
    """Write files for the CSV readers of `stonesoup.reader.generic`: detections and tracks of each UAV separately.

    A reader makes a set of all rows of one time, and Stone Soup's association takes a set as one sensor's scan.
    """
    found = list_measurements(recording)
    tracks = list_tracks(recording)
    for uav in range(recording.uav_count):
        rows = list_rows(found, _MEASUREMENT, found["uav"] == uav)
        write_table(folder / f"detections-uav{uav}.csv", _MEASUREMENT, rows)
        write_table(folder / f"tracks-uav{uav}.csv", _TRACK, list_rows(tracks, _TRACK, tracks["uav"] == uav))
    truth = list_rows(list_truth(recording), ("time", "person", *STATE))
    write_table(folder / "groundtruth.csv", ("time", "id", *STATE), truth)
    k, i = np.nonzero(recording.frames_taken)
    x, y, z = recording.believed_cameras[k, i, :3].T
    sensors = {"time": recording.times[k], "uav": i, "x": x, "y": y, "z": z}
    write_table(folder / "sensors.csv", tuple(sensors), list_rows(sensors, tuple(sensors)))


def write_tables(recording: Recording, folder: Path) -> None:
    """Write the tables of `Flight.table` as Parquet files; InputError without pandas with pyarrow, or polars."""
    flight = Flight(recording)
    for name in TABLES:
        frame = make_dataframe(flight.columns(name))
        try:
            (frame.to_parquet if hasattr(frame, "to_parquet") else frame.write_parquet)(folder / f"{name}.parquet")
        except ImportError as error:
            raise InputError("parquet: needs pandas with pyarrow, or polars: pip install pyarrow") from error
