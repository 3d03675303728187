"""The files of a flight from elsewhere, in any of the formats that `track` reads."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from sim.exchange.csv_files import read_cameras, read_detections, read_forest, read_poses
from sim.exchange.image_labels import read_coco
from sim.exchange.mot import find_sequences, read_sequences
from sim.exchange.ros_flight import find_bag, read_bag
from sim.exchange.values import CameraFrames, LoggedFlight, LoggedFrame, LoggedUav, PoseLog, find_gap
from tracking.errors import InputError, list_numbers, spell
from tracking.geometry.visibility import Forest

_LIKELY = ((1e7, "nanoseconds"), (1e4, "microseconds"), (20.0, "milliseconds"))  # with as many s between frames
_FARTHEST = 9_000.0  # m, of places from the origin


Uavs = Mapping[int, LoggedUav]


def _detect_in_images(folder: Path, uavs: Uavs, detector: str) -> dict[int, CameraFrames]:
    from sim.exchange.images import detect_in_images  # here, as only images need OpenCV

    return detect_in_images(folder / "images.csv", detector, uavs, _read_trees(folder, (0.0, 0.0)))


# Formats of detections by files that tell them, and their readers; of several the first.
_FORMATS: dict[str, Callable[[Path, Uavs, str], dict[int, CameraFrames]]] = {
    "detections.csv": lambda folder, *_: read_detections(folder / "detections.csv"),
    "results.json": lambda folder, *_: read_coco(folder),
    "det/det.txt": lambda folder, *_: read_sequences(folder),
    "uav[0-9]*/det/det.txt": lambda folder, *_: read_sequences(folder),
    "images.csv": _detect_in_images,
}


def read_files(folder: Path, origin: tuple[float, float], detector: str) -> LoggedFlight:
    """The files of a flight in a folder, whose places have this `origin` [m]; InputError says what to change.

    detector: name of what finds people if the flight has images in place of detections.
    """
    if not folder.is_dir():
        raise InputError(f"FLIGHT: {folder} is not a folder; expected one with poses.csv and detections.csv, or a bag")
    logged = None if (folder / "poses.csv").exists() else find_bag(folder)
    bag = read_bag(logged) if logged else {}
    own = folder / "cameras.csv"
    cameras = {i: uav.camera for i, uav in bag.items()} if bag and not own.exists() else read_cameras(own)
    poses = {i: uav.poses for i, uav in bag.items()} or read_poses(folder / "poses.csv")
    read = next((read for name, read in _FORMATS.items() if any(folder.glob(name))), None)
    if read is None and bag:
        found = {i: CameraFrames(uav.frames) for i, uav in bag.items()}
    else:
        known = {i: LoggedUav(cameras[i], poses[i], []) for i in cameras if i in poses}
        found = (read or _FORMATS["detections.csv"])(folder, known, detector)
    for name, numbers in (("its poses", {*poses}), ("its detections", {*found})):
        if odd := sorted(numbers ^ {*cameras}):
            raise InputError(f"FLIGHT: {folder}: only one of {name} and its cameras has {list_numbers('UAV', odd)}")
    if sorted(cameras) != list(range(len(cameras))):
        raise InputError(f"FLIGHT: {folder}: has {list_numbers('UAV', sorted(cameras))}; number UAVs from 0")
    for uav, seen in found.items():
        gap = find_gap(seen.frames)
        if unit := next((unit for least, unit in _LIKELY if gap > least), ""):
            span = f"frames of UAV {uav} are {spell(gap, 3)} s apart"
            raise InputError(f"detections: {folder}, column time_s: {span}; are these {unit}?")
    start = min(seen.frames[0].time + cameras[uav].clock_offset for uav, seen in found.items())
    uavs = []
    for i in range(len(cameras)):
        size = found[i].size
        camera = cameras[i] if size is None else cameras[i].fit(size, f"FLIGHT: {folder}, UAV {i}")
        later = camera.clock_offset - start
        moved = PoseLog(poses[i].times + later, poses[i].rows - [*origin, 0.0, 0.0, 0.0, 0.0, 0.0])
        frames = [_shift(frame, later, origin) for frame in found[i].frames]
        people = [_shift(frame, later, origin) for frame in found[i].people]
        uavs.append(LoggedUav(camera, moved, frames, people))
    remarks = tuple(remark for seen in found.values() for remark in seen.remarks)
    flight = LoggedFlight(uavs, _read_trees(folder, origin), start, origin, _find_labels(folder, found), remarks)
    far = flight.places[np.abs(flight.places).max(axis=1) > _FARTHEST]
    if len(far):
        x, y = (np.array(origin) + far[0]).round(-2).tolist()
        place = f"({spell(far[0, 0], 3)}, {spell(far[0, 1], 3)}) m is {_FARTHEST:g} m or more from the origin"
        raise InputError(f"FLIGHT: {folder}: {place}; give one in the area: --origin {spell(x)},{spell(y)}")
    return flight


def _read_trees(folder: Path, origin: tuple[float, float]) -> Forest:
    stems = folder / "trees.csv"
    return read_forest(stems, origin) if stems.exists() else Forest(())


def _find_labels(folder: Path, found: Mapping[int, CameraFrames]) -> Path | None:
    """The file of the people: `truth.csv`, or else that of the first sequence of MOTChallenge with people."""
    table = folder / "truth.csv"
    if table.exists():
        return table
    sequences = find_sequences(folder).items()
    return next((path / "gt" / "gt.txt" for uav, path in sequences if uav in found and found[uav].people), None)


def _shift(frame: LoggedFrame, later: float, origin: tuple[float, float]) -> LoggedFrame:
    x, y = origin
    moved = [found._replace(place=(found.place[0] - x, found.place[1] - y)) for found in frame.detections]
    return LoggedFrame(frame.time + later, frame.where, moved)
