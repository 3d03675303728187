"""The files of a flight from elsewhere, read and checked."""

from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim.flights.bag import BagFlight, find_bag, read_bag
from sim.flights.flight_tables import (
    CameraRow,
    Fleet,
    Frame,
    Poses,
    measure_gap,
    read_cameras,
    read_detections,
    read_forest,
    read_poses,
)
from sim.flights.mot import find_sequences, read_sequence
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
    people: Fleet  # the people in frames of MOTChallenge, with their ids

    @property
    def places(self) -> Array:
        """Places (N, 2) m of poses and trees."""
        return np.vstack([*(poses.rows[:, :2] for poses in self.poses.values()), self.forest.table[:, :2]])


def read_files(folder: Path, origin: tuple[float, float]) -> FlightFiles:
    """The files of a flight in a folder, whose places have this `origin` [m]; InputError says what to change."""
    if not folder.is_dir():
        raise InputError(f"FLIGHT: {folder} is not a folder; expected one with poses.csv and detections.csv, or a bag")
    bag = find_bag(folder)
    told = read_bag(bag) if bag and not (folder / "poses.csv").exists() else None
    own = folder / "cameras.csv"
    cameras = told.cameras if told and not own.exists() else read_cameras(own)
    poses = told.poses if told else read_poses(folder / "poses.csv")
    found = _read_detections(folder, cameras, told)
    for name, uavs in (("its poses", {*poses}), ("its detections", {*found.fleet})):
        if odd := sorted(uavs ^ {*cameras}):
            raise InputError(f"FLIGHT: {folder}: only one of {name} and its cameras has {list_numbers('UAV', odd)}")
    if sorted(cameras) != list(range(len(cameras))):
        raise InputError(f"FLIGHT: {folder}: has {list_numbers('UAV', sorted(cameras))}; number UAVs from 0")
    for uav, frames in found.fleet.items():
        gap = measure_gap(frames)
        if unit := next((unit for least, unit in _LIKELY if gap > least), ""):
            span = f"frames of UAV {uav} are {spell(gap, 3)} s apart"
            raise InputError(f"detections: {folder / 'detections.csv'}, column time_s: {span}; are these {unit}?")
    start = min(frames[0].time + cameras[uav].clock_offset for uav, frames in found.fleet.items())
    later = {uav: camera.clock_offset - start for uav, camera in sorted(cameras.items())}
    poses = {uav: _shift_poses(poses[uav], later[uav], origin) for uav in later}
    fleet, people = (
        {uav: [_shift_frame(frame, later[uav], origin, cameras[uav]) for frame in frames[uav]] for uav in later}
        for frames in (found.fleet, found.people)
    )
    stems = folder / "trees.csv"
    forest = read_forest(stems, origin) if stems.exists() else Forest(())
    ordered = dict(sorted(cameras.items()))
    files = FlightFiles(ordered, poses, fleet, forest, start, origin, found.labels, people)
    far = files.places[np.abs(files.places).max(axis=1) > _FARTHEST]
    if len(far):
        x, y = (np.array(origin) + far[0]).round(-2).tolist()
        place = f"({spell(far[0, 0], 3)}, {spell(far[0, 1], 3)}) m is {_FARTHEST:g} m or more from the origin"
        raise InputError(f"FLIGHT: {folder}: {place}; give one in the area: --origin {spell(x)},{spell(y)}")
    return files


class _Found(NamedTuple):
    """Detections of a flight, and its people if they are known."""

    fleet: Fleet
    people: defaultdict[int, list[Frame]]
    labels: Path | None


def _read_detections(folder: Path, cameras: dict[int, CameraRow], bag: BagFlight | None) -> _Found:
    """Detections in `detections.csv`, sequences of MOTChallenge or a bag.

    By sequences, `cameras` get the size of their images.
    """
    labels, sequences = folder / "truth.csv", find_sequences(folder)
    known = labels if labels.exists() else None
    table = folder / "detections.csv"
    if table.exists() or not sequences:
        fleet = bag.fleet if bag and not table.exists() else read_detections(table)
        return _Found(fleet, defaultdict(list), known)
    fleet, people = Fleet(), defaultdict[int, list[Frame]](list)
    for uav, path in sequences.items():
        sequence = read_sequence(path)
        fleet[uav] = sequence.detections
        if sequence.people is not None and known is None:
            people[uav] = sequence.people
        if uav in cameras and sequence.size is not None:
            cameras[uav] = _fit_camera(cameras[uav], sequence.size, f"FLIGHT: {path}")
    return _Found(fleet, people, path / "gt" / "gt.txt" if people else known)


def _fit_camera(camera: CameraRow, size: tuple[int, int], where: str) -> CameraRow:
    """The camera with the size of its images; InputError unless it fits them."""
    if camera.pixels == min(size):
        return camera._replace(size=size)
    images = f"images have {size[0]} × {size[1]} pixels, but the camera in cameras.csv has {camera.pixels}"
    raise InputError(f"{where}: {images}; give it {min(size)}, and the angle of view over these")


def _shift_poses(poses: Poses, later: float, origin: tuple[float, float]) -> Poses:
    return Poses(poses.times + later, poses.rows - [*origin, 0.0, 0.0, 0.0, 0.0, 0.0])


def _shift_frame(frame: Frame, later: float, origin: tuple[float, float], camera: CameraRow) -> Frame:
    corner = [(edge - camera.pixels) / 2 for edge in camera.size]  # of the square in the middle of the image
    moved = [
        found._replace(
            place=(found.place[0] - origin[0], found.place[1] - origin[1]),
            pixel=(found.pixel[0] - corner[0], found.pixel[1] - corner[1]),
        )
        for found in frame.detections
    ]
    return Frame(frame.time + later, frame.where, moved)
