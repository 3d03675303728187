"""The files of a flight from elsewhere, in any of the formats that `track` reads."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from sim.exchange.csv_files import has_quaternions, read_cameras, read_detections, read_poses
from sim.exchange.flight_doubts import find_doubts, turn
from sim.exchange.flight_logs import TRUTHS, VIDEOS, YEARS, find_logs, find_videos, locate, read_logs, tell_formats
from sim.exchange.flight_setting import find_stem_map
from sim.exchange.image_labels import read_coco
from sim.exchange.mot import find_sequences, read_sequences
from sim.exchange.people_selection import Selection, select_people
from sim.exchange.ros_flight import BagFlight, find_bag, read_bag
from sim.exchange.values import CameraFrames, LoggedCamera, LoggedFlight, LoggedFrame, LoggedUav, PoseLog, find_gap
from sim.scenario.csv_tables import read_csv
from sim.scenario.environment import Trees
from sim.scenario.geo import FARTHEST, Geo
from sim.scenario.scenario import Scenario
from sim.world.stem_map import StemMap, read_stem_map
from sim.world.terrain import Terrain, read_terrain
from tracking.errors import InputError, list_numbers, spell
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array

# Units of times with more than so many s between frames, or since an epoch; in seconds, 1e11 are 3000 years.
_LIKELY = ((1e7, 1e17, "nanoseconds"), (1e4, 1e14, "microseconds"), (20.0, 1e11, "milliseconds"))


Uavs = Mapping[int, LoggedUav]


def _detect_in_images(folder: Path, uavs: Uavs, detector: str, trees: Trees, geo: Geo) -> dict[int, CameraFrames]:
    from sim.exchange.images import detect_in_images  # here, as only images need OpenCV

    return detect_in_images(folder / "images.csv", detector, uavs, Forest(_read_trees(folder, trees, geo).trees))


def _detect_in_videos(folder: Path, uavs: Uavs, detector: str, trees: Trees, geo: Geo) -> dict[int, CameraFrames]:
    from sim.exchange.images import detect_in_videos  # here, as only images need OpenCV

    return detect_in_videos(find_videos(folder), detector, uavs, Forest(_read_trees(folder, trees, geo).trees))


# Formats of detections by files that tell them, and their readers; of several the first.
_Read = Callable[[Path, Uavs, str, Trees, Geo], dict[int, CameraFrames]]
_FORMATS: dict[str, _Read] = {
    "detections.csv": lambda folder, *others: read_detections(folder / "detections.csv", others[-1]),
    "results.json": lambda folder, *_: read_coco(folder),
    "det/det.txt": lambda folder, *_: read_sequences(folder),
    "uav[0-9]*/det/det.txt": lambda folder, *_: read_sequences(folder),
    "images.csv": _detect_in_images,
    VIDEOS: _detect_in_videos,
}


def read_files(
    folder: Path, origin: tuple[float, float], own: Scenario, detector: str, selection: Selection
) -> LoggedFlight:
    """The files of a flight in a folder, whose places have this `origin` [m]; InputError says what to change.

    own: where the map and the ground are, and how to read the stem map. detector: name of what finds people if the
    flight has images in place of detections. selection: of people among detections.
    """
    if not folder.is_dir() and find_bag(folder) is None:
        expected = "expected one with poses.csv and detections.csv, or a bag of ROS 2"
        raise InputError(f"FLIGHT: {folder} is not a folder; {expected}")
    read, unused = _choose_format(folder)
    (cameras, poses, seen, told, epoch, longer), geo, ground = _read_parts(folder, own, detected=read is not None)
    if geo.origin and origin != (0.0, 0.0):
        raise InputError("--origin: not allowed for places on the map; --set geo.origin=[latitude,longitude] is theirs")
    known = {i: LoggedUav(cameras[i], poses[i], []) for i in cameras if i in poses}
    found = seen or (read or _FORMATS["detections.csv"])(folder, known, detector, own.trees, geo)
    if ground.surface and read in (_detect_in_images, _detect_in_videos):
        found = {uav: frames.without_places() for uav, frames in found.items()}
    found, remarks = select_people(found, selection)
    for name, numbers in (("its poses", {*poses}), ("its detections", {*found})):
        if odd := sorted(numbers ^ {*cameras}):
            raise InputError(f"FLIGHT: {folder}: only one of {name} and its cameras has {list_numbers('UAV', odd)}")
    if sorted(cameras) != list(range(len(cameras))):
        raise InputError(f"FLIGHT: {folder}: has {list_numbers('UAV', sorted(cameras))}; number UAVs from 0")
    _check_units(found, folder)
    start = min(own.frames[0].time + cameras[uav].clock_offset for uav, own in found.items())
    uavs = []
    for i in range(len(cameras)):
        size = found[i].size
        camera = cameras[i] if size is None else cameras[i].fit(size, f"FLIGHT: {folder}, UAV {i}")
        later = camera.clock_offset - start
        flown = poses[i].cut(found[i].frames[0].time, found[i].frames[-1].time) if longer else poses[i]
        moved = PoseLog(_delay(flown.times, later), flown.rows - [*origin, 0.0, 0.0, 0.0, 0.0, 0.0])
        frames = [_shift(frame, later, origin) for frame in found[i].frames]
        people = [_shift(frame, later, origin) for frame in found[i].people]
        uavs.append(LoggedUav(camera, moved, frames, people))
    stems = _read_trees(folder, replace(own.trees, origin=origin), geo)
    remarks = [*told, *remarks, *(remark for own in found.values() for remark in own.remarks)]
    remarks += [*unused, *_tell_spans(uavs)]
    remarks += [*find_doubts(folder, uavs, geo), *filter(None, (stems.summary, *stems.remarks))]
    labels = _find_labels(folder, found)
    if start < YEARS < epoch and _are_since_1970(labels):
        start += epoch  # of the first frame, by the clock of people
        remarks.append(f"truth: times of people are since 1970, when times of frames begin at {spell(epoch)} s")
    flight = LoggedFlight(uavs, Forest(stems.trees), start, origin, geo, labels, ground.moved(origin), remarks)
    far = flight.places[np.abs(flight.places).max(axis=1) > FARTHEST]
    if len(far):
        x, y = (np.array(origin) + far[0]).round(-2).tolist()
        place = f"({spell(far[0, 0], 3)}, {spell(far[0, 1], 3)}) m is {FARTHEST:g} m or more from the origin"
        raise InputError(f"FLIGHT: {folder}: {place}; give one in the area: --origin {spell(x)},{spell(y)}")
    return flight


def _read_parts(folder: Path, own: Scenario, *, detected: bool) -> tuple[BagFlight, Geo, Terrain]:
    """Cameras and poses, from tables, logs or a bag, which also gives frames unless these are `detected`; and the map.

    own: as of `read_files`.
    """
    cameras_file, poses_file, unused = folder / "cameras.csv", folder / "poses.csv", list[str]()
    other = poses_file.exists() or find_bag(folder) is not None
    logs = {} if other else find_logs(folder)
    if other and (names := ", ".join(path.name for path in tell_formats(folder))):
        unused = [f"logs: not used: {names}, as there {'is poses.csv' if poses_file.exists() else 'is a bag'}"]
    geo, told = locate(folder, own.geo, logs)
    ground, heights = read_terrain(folder, own.ground, geo)
    told += heights
    if logs:
        given = read_cameras(cameras_file) if cameras_file.exists() else {}
        found = read_logs(folder, logs, given, geo, ground)
        return found._replace(remarks=told + found.remarks), geo, ground
    there = {"cameras": cameras_file.exists(), "poses": poses_file.exists(), "detections": detected}
    lacking = [part for part, found in there.items() if not found]
    logged = find_bag(folder) if lacking else None
    bag = read_bag(logged, lacking) if logged else BagFlight({}, {}, {}, [])
    cameras = bag.cameras or read_cameras(cameras_file)
    if bag.poses or not has_quaternions(poses_file):
        unused += _tell_axes(cameras.values(), "a bag has its own" if bag.poses else "it has none")
        cameras = {i: camera._replace(axes="") for i, camera in cameras.items()}
    poses = bag.poses or _turn(read_poses(poses_file, geo, ground), cameras)
    return BagFlight(cameras, poses, bag.frames, [*told, *unused, *bag.remarks]), geo, ground


def _choose_format(folder: Path) -> tuple[_Read | None, list[str]]:
    """What reads the detections of a folder, if there are some, and a remark on those that are not used."""
    found = [name for name in _FORMATS if any(folder.glob(name))]
    if not found:
        return None, []
    others = ", ".join(name for name in found[1:] if name != VIDEOS)
    return _FORMATS[found[0]], [f"detections: not used: {others}, as there is {found[0]}"] if others else []


def _tell_axes(cameras: Iterable[LoggedCamera], instead: str) -> list[str]:
    """A remark on axes of quaternions that are not used."""
    given = sorted({camera.axes for camera in cameras} - {"image"})
    what = f"cameras: not used: column axes, {', '.join(given)}, which are of quaternions in poses.csv; {instead}"
    return [what] if given else []


def _tell_spans(uavs: Sequence[LoggedUav]) -> list[str]:
    """What angles of view are over, where they are over a part of the images."""
    spans = [uav.camera.spans for uav in uavs]
    own = {text: [i for i, other in enumerate(spans) if other == text] for text in spans if text}
    return [f"cameras: {list_numbers('UAV', numbers)}: {text}" for text, numbers in own.items()]


def _turn(poses: Mapping[int, PoseLog], cameras: Mapping[int, LoggedCamera]) -> dict[int, PoseLog]:
    """The poses with attitudes of images, at times of frames."""
    turned = {}
    for i, log in poses.items():
        axes, given = (cameras[i].axes, cameras[i].given) if i in cameras else ("image", {})
        times = _delay(log.times, given.get("pose_offset_s", 0.0))
        turned[i] = PoseLog(times, np.hstack([log.rows[:, :3], turn(log.rows[:, 3:], axes)]))
    return turned


def _read_trees(folder: Path, trees: Trees, geo: Geo) -> StemMap:
    path = find_stem_map(folder)
    return read_stem_map(path, "trees", trees, least=0.0, geo=geo) if path else StemMap((), (), "", ())


def _find_labels(folder: Path, found: Mapping[int, CameraFrames]) -> Path | None:
    """The file of the people: one of `TRUTHS`, or else that of the first sequence of MOTChallenge with people."""
    if tables := [folder / name for name in TRUTHS if (folder / name).exists()]:
        return tables[0]
    sequences = find_sequences(folder).items()
    return next((path / "gt" / "gt.txt" for uav, path in sequences if uav in found and found[uav].people), None)


def _check_units(found: Mapping[int, CameraFrames], folder: Path) -> None:
    """InputError if times of frames are not in seconds."""
    for uav, own in found.items():
        gap = find_gap(own.frames)
        time = own.frames[0].time
        if unit := next((unit for apart, since, unit in _LIKELY if gap > apart or abs(time) > since), ""):
            span = f"frames of UAV {uav} are {spell(gap, 3)} s apart, and begin at {spell(time)} s"
            raise InputError(f"detections: {folder}, column time_s: {span}; are these {unit}?")


def _are_since_1970(labels: Path | None) -> bool:
    """True if a table of people has such times."""
    if labels is None or labels.name not in TRUTHS:
        return False
    row = next(read_csv(labels, "truth", (), spares={"time": "time_s", "t": "time_s", "timestamp": "time_s"}), None)
    return row is not None and "time_s" in row.values and row.time("time_s") > YEARS


def _shift(frame: LoggedFrame, later: float, origin: tuple[float, float]) -> LoggedFrame:
    x, y = origin
    moved = [found._replace(place=(found.place[0] - x, found.place[1] - y)) for found in frame.detections]
    return LoggedFrame(float(_delay(np.array(frame.time), later)), frame.where, moved)


def _delay(times: Array, later: float) -> Array:
    """Times [s], so much [s] later; to the nanosecond, as a stamp less the first one is not exact."""
    return (times + later).round(9) if later else times
