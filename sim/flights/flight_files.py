"""The files of a flight from elsewhere, read and checked."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim.flights.flight_tables import (
    CameraRow,
    Fleet,
    Frame,
    Poses,
    read_cameras,
    read_detections,
    read_forest,
    read_poses,
)
from tracking.errors import InputError, list_numbers, spell
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array

_LIKELY = ((1e7, "nanoseconds"), (1e4, "microseconds"), (20.0, "milliseconds"))  # with as many s between frames
_FARTHEST = 9_000.0  # m, of places from the origin


class FlightFiles(NamedTuple):
    """The files of a flight, with times [s] since its first frame and places [m] from its origin."""

    cameras: dict[int, CameraRow]
    poses: dict[int, Poses]
    fleet: Fleet
    forest: Forest
    start: float  # s, time in the files of the first frame
    origin: tuple[float, float]  # m, place in the files of the origin
    labels: Path | None  # file of the people, if they are known

    @property
    def places(self) -> Array:
        """Places (N, 2) m of poses and trees."""
        return np.vstack([*(poses.rows[:, :2] for poses in self.poses.values()), self.forest.table[:, :2]])


def read_files(folder: Path, origin: tuple[float, float]) -> FlightFiles:
    """The files of a flight in a folder, whose places have this `origin` [m]; InputError says what to change."""
    if not folder.is_dir():
        raise InputError(f"FLIGHT: {folder} is not a folder; expected one with poses.csv and detections.csv")
    cameras = read_cameras(folder / "cameras.csv")
    poses, fleet = read_poses(folder / "poses.csv"), read_detections(folder / "detections.csv")
    for name, uavs in (("poses.csv", {*poses}), ("detections.csv", {*fleet})):
        if odd := sorted(uavs ^ {*cameras}):
            raise InputError(f"FLIGHT: {folder}: only one of {name} and cameras.csv has {list_numbers('UAV', odd)}")
    if sorted(cameras) != list(range(len(cameras))):
        raise InputError(f"FLIGHT: {folder}: has {list_numbers('UAV', sorted(cameras))}; number UAVs from 0")
    for uav, frames in fleet.items():
        gap = float(np.median(np.diff([frame.time for frame in frames]))) if len(frames) > 1 else 0.0
        if unit := next((unit for least, unit in _LIKELY if gap > least), ""):
            span = f"frames of UAV {uav} are {spell(gap, 3)} s apart"
            raise InputError(f"detections: {folder / 'detections.csv'}, column time_s: {span}; are these {unit}?")
    start = min(frames[0].time + cameras[uav].clock_offset for uav, frames in fleet.items())
    later = {uav: camera.clock_offset - start for uav, camera in sorted(cameras.items())}
    poses = {uav: _shift_poses(poses[uav], later[uav], origin) for uav in later}
    fleet = {uav: [_shift_frame(frame, later[uav], origin) for frame in fleet[uav]] for uav in later}
    stems = folder / "trees.csv"
    forest = read_forest(stems, origin) if stems.exists() else Forest(())
    labels = folder / "truth.csv"
    known = labels if labels.exists() else None
    files = FlightFiles(dict(sorted(cameras.items())), poses, fleet, forest, start, origin, known)
    far = files.places[np.abs(files.places).max(axis=1) > _FARTHEST]
    if len(far):
        x, y = (np.array(origin) + far[0]).round(-2).tolist()
        place = f"({spell(far[0, 0], 3)}, {spell(far[0, 1], 3)}) m is {_FARTHEST:g} m or more from the origin"
        raise InputError(f"FLIGHT: {folder}: {place}; give one in the area: --origin {spell(x)},{spell(y)}")
    return files


def _shift_poses(poses: Poses, later: float, origin: tuple[float, float]) -> Poses:
    return Poses(poses.times + later, poses.rows - [*origin, 0.0, 0.0, 0.0, 0.0, 0.0])


def _shift_frame(frame: Frame, later: float, origin: tuple[float, float]) -> Frame:
    moved = [
        found._replace(place=(found.place[0] - origin[0], found.place[1] - origin[1])) for found in frame.detections
    ]
    return Frame(frame.time + later, frame.where, moved)
