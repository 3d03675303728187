"""The files of a flight from elsewhere, read and checked."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim.exchange.bag import BagFlight, find_bag, read_bag
from sim.exchange.coco import RESULTS, read_coco
from sim.exchange.flight_tables import (
    CameraFrames,
    CameraRow,
    Fleet,
    LoggedFrame,
    Poses,
    measure_gap,
    read_cameras,
    read_detections,
    read_forest,
    read_poses,
)
from sim.exchange.mot import find_sequences, read_sequence
from tracking.errors import InputError, list_numbers, spell
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array

_LIKELY = ((1e7, "nanoseconds"), (1e4, "microseconds"), (20.0, "milliseconds"))  # with as many s between frames
IMAGES = "images.csv"  # table of images, in place of detections
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


def read_files(folder: Path, origin: tuple[float, float], detector: str) -> FlightFiles:
    """The files of a flight in a folder, whose places have this `origin` [m]; InputError says what to change.

    detector: name of what finds people if the flight has images in place of detections.
    """
    if not folder.is_dir():
        raise InputError(f"FLIGHT: {folder} is not a folder; expected one with poses.csv and detections.csv, or a bag")
    logged = find_bag(folder)
    bag = read_bag(logged) if logged and not (folder / "poses.csv").exists() else None
    own = folder / "cameras.csv"
    cameras = bag.cameras if bag and not own.exists() else read_cameras(own)
    poses = bag.poses if bag else read_poses(folder / "poses.csv")
    found = _find_frames(folder, cameras, poses, bag, detector)
    for name, uavs in (("its poses", {*poses}), ("its detections", {*found})):
        if odd := sorted(uavs ^ {*cameras}):
            raise InputError(f"FLIGHT: {folder}: only one of {name} and its cameras has {list_numbers('UAV', odd)}")
    if sorted(cameras) != list(range(len(cameras))):
        raise InputError(f"FLIGHT: {folder}: has {list_numbers('UAV', sorted(cameras))}; number UAVs from 0")
    for uav, frames in found.items():
        gap = measure_gap(frames.detections)
        if unit := next((unit for least, unit in _LIKELY if gap > least), ""):
            span = f"frames of UAV {uav} are {spell(gap, 3)} s apart"
            raise InputError(f"detections: {folder}, column time_s: {span}; are these {unit}?")
    start = min(frames.detections[0].time + cameras[uav].clock_offset for uav, frames in found.items())
    files = FlightFiles(
        cameras={
            uav: camera if (size := found[uav].size) is None else camera.fit(size, f"FLIGHT: {folder}, UAV {uav}")
            for uav, camera in sorted(cameras.items())
        },
        poses={},
        fleet={},
        forest=_read_trees(folder, origin),
        start=start,
        origin=origin,
        labels=_find_labels(folder, found),
        people={},
    )
    for uav, camera in files.cameras.items():
        later = camera.clock_offset - start
        files.poses[uav] = Poses(poses[uav].times + later, poses[uav].rows - [*origin, 0.0, 0.0, 0.0, 0.0, 0.0])
        files.fleet[uav] = [_shift_frame(frame, later, origin) for frame in found[uav].detections]
        files.people[uav] = [_shift_frame(frame, later, origin) for frame in found[uav].people]
    far = files.places[np.abs(files.places).max(axis=1) > _FARTHEST]
    if len(far):
        x, y = (np.array(origin) + far[0]).round(-2).tolist()
        place = f"({spell(far[0, 0], 3)}, {spell(far[0, 1], 3)}) m is {_FARTHEST:g} m or more from the origin"
        raise InputError(f"FLIGHT: {folder}: {place}; give one in the area: --origin {spell(x)},{spell(y)}")
    return files


def _find_frames(
    folder: Path, cameras: Mapping[int, CameraRow], poses: Mapping[int, Poses], bag: BagFlight | None, detector: str
) -> Mapping[int, CameraFrames]:
    """Frames of each UAV in `detections.csv`, results of COCO, sequences of MOTChallenge, images or a bag."""
    table, sequences = folder / "detections.csv", find_sequences(folder)
    if table.exists():
        fleet = read_detections(table)
    elif (folder / RESULTS).exists():
        return read_coco(folder)
    elif sequences:
        return {uav: read_sequence(path) for uav, path in sequences.items()}
    elif (folder / IMAGES).exists():
        from sim.exchange.images import detect_in_images  # here, as only images need OpenCV

        return detect_in_images(folder / IMAGES, detector, cameras, poses, _read_trees(folder, (0.0, 0.0)))
    else:
        fleet = bag.fleet if bag else read_detections(table)
    return {uav: CameraFrames(frames) for uav, frames in fleet.items()}


def _read_trees(folder: Path, origin: tuple[float, float]) -> Forest:
    stems = folder / "trees.csv"
    return read_forest(stems, origin) if stems.exists() else Forest(())


def _find_labels(folder: Path, found: Mapping[int, CameraFrames]) -> Path | None:
    """The file of the people: `truth.csv`, or else that of the first sequence of MOTChallenge with people."""
    table = folder / "truth.csv"
    if table.exists():
        return table
    labelled = [
        path / "gt" / "gt.txt" for uav, path in find_sequences(folder).items() if uav in found and found[uav].people
    ]
    return labelled[0] if labelled else None


def _shift_frame(frame: LoggedFrame, later: float, origin: tuple[float, float]) -> LoggedFrame:
    moved = [
        found._replace(place=(found.place[0] - origin[0], found.place[1] - origin[1])) for found in frame.detections
    ]
    return LoggedFrame(frame.time + later, frame.where, moved)
