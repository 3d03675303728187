"""Logs of drones in a flight, told by their content: where they are on the map, and cameras and poses from them."""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from sim.exchange.air_data import read_air_data
from sim.exchange.ardupilot_log import read_ardupilot
from sim.exchange.csv_files import ANGLES, KNOWN
from sim.exchange.dji_srt import read_srt
from sim.exchange.flight_doubts import turn
from sim.exchange.px4_log import read_ulog
from sim.exchange.ros_flight import BagFlight
from sim.exchange.trajectory_log import read_trajectory
from sim.exchange.values import DroneLog, LoggedCamera, PoseLog, find_attitudes, make_calibrated_camera
from sim.scenario.camera_settings import CameraSettings
from sim.scenario.csv_tables import find_map_origin, find_middle, read_csv
from sim.scenario.geo import FARTHEST, Geo, tell_origin
from sim.world.terrain import Terrain
from tracking.errors import InputError, list_numbers, spell
from tracking.numerics.arrays import Array
from tracking.settings import read_settings

TRUTHS = ("truth.csv", "truth.gpx")  # files of people
VIDEOS = "*.[mM][pPoO][4vV]"  # files of videos, .mp4 and .mov
_HEAD = 4096  # bytes, by which a format is told
_POSE = rb"(?:[-+.\deE]+[ \t]+){7}[-+.\deE]+[ \t]*\r?\n"
_FORMATS: dict[str, tuple[bytes, Callable[[Path], DroneLog]]] = {
    "DJI SRT": (rb"(\xef\xbb\xbf)?\s*\d+\s*\n(\d+:\d\d:\d\d[,.]\d+ *-->|\d{4}[-.]\d)", read_srt),
    "AirData CSV": (rb"(?i)[^\n]*(time\(millisecond\)|height_above_takeoff)", read_air_data),
    "ULog of PX4": (rb"ULog\x01\x12\x35", read_ulog),
    "log of ArduPilot": (rb"\xa3\x95|(?s:.*)\bFMT, ?128, ?89, ?FMT", read_ardupilot),
    "EuRoC trajectory": (rb"#? ?timestamp[^\n]*p_RS_R_x", read_trajectory),
    "TUM trajectory": (rb"(#[^\n]*\n)*(%s){2}" % _POSE, read_trajectory),
}
# Files that are told, but not read, and what to give in their place.
_REFUSED = {
    rb"[^\n]*OSD\.(latitude|flyTime)": "is DJI's flight record as CSV, which is not read; give AirData's CSV of it",
    rb"(?s).{16}BUILD": "is DJI's DAT log, which is not read; give the video's SRT, or AirData's CSV of the flight",
    rb"(?s)\s*<.*<kml": "is KML, which is not read; give the log itself, or GPX as truth.gpx if it is of people",
    rb"# Image list with two lines": 'is COLMAP\'s images.txt, which is not read; give poses.csv, with "optical" axes',
    rb"# Camera list with one line": "is COLMAP's cameras.txt, which is not read; give cameras.csv",
}
_STATION = "is of a ground station, which is not read; give the drone's own log"
_PLAIN = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".toml", ".yaml", ".yml", ".json", ".mp4", ".mov", ".npz", ".md"}
_OWN = {f"{name}.csv" for name in ("poses", "detections", "cameras", "trees", "truth", "tracks", "images")}
YEARS = 1e8  # s, beyond which times are since 1970
_SHORT, _SHORT_SHARE = 1.0, 0.02  # s, and of its length, by which a video and its log may differ
_FILM = 34.6  # mm, width of a sensor of 4:3 with the corners of 35 mm film, 43.3 mm apart
_TAKEN = {
    "frd": "the camera is taken to look down from the body; pitch_deg, or axes, in cameras.csv says otherwise",
    "optical": "axes are taken to be optical, z ahead; axes in cameras.csv says otherwise",
}


def tell_formats(folder: Path) -> dict[Path, str]:
    """Formats of the logs in a folder by their paths; what is not read begins with "is"."""
    found = dict[Path, str]()
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if path.name not in _OWN and path.suffix.lower() not in _PLAIN and path.is_file():
            with path.open("rb") as file:
                head = file.read(_HEAD)
            told = [name for name, (first, _) in _FORMATS.items() if re.match(first, head)]
            told += [what for key, what in _REFUSED.items() if re.match(key, head)]
            told += [_STATION] if path.suffix.lower() == ".tlog" else []
            if told:
                found[path] = told[0]
    return found


def find_logs(folder: Path) -> dict[int, DroneLog]:
    """The logs in a folder by UAV, by names such as uav1.SRT, else in order of names; InputError for unread ones."""
    found = tell_formats(folder)
    if odd := [f"{path} {name}" for path, name in found.items() if name not in _FORMATS]:
        raise InputError(f"FLIGHT: {odd[0]}")
    return {i: _FORMATS[found[path]][1](path)._replace(format=found[path]) for i, path in _number(found).items()}


def find_videos(folder: Path) -> dict[int, Path]:
    """Videos of a folder by UAV, as `find_logs`."""
    return _number(sorted(folder.glob(VIDEOS)))


def _number(paths: Iterable[Path]) -> dict[int, Path]:
    """Files by UAV: numbered ones such as uav1.SRT by their numbers, others by their order."""
    found: dict[int, Path] = {}
    for i, path in enumerate(paths):
        number = re.search(r"(?i)uav_?(\d+)", path.stem)
        uav = int(number[1]) if number else i
        if uav in found:
            raise InputError(f"FLIGHT: {path} and {found[uav].name} are both of UAV {uav}; expected one of them")
        found[uav] = path
    return found


def locate(folder: Path, geo: Geo, logs: Mapping[int, DroneLog]) -> tuple[Geo, list[str]]:
    """The map with its origin, by default in the middle of the first file with places on it, and a remark on it."""
    found = [(one.path.name, find_middle(*_find_fixes(one).T)) for one in logs.values() if len(_find_fixes(one))]
    names = [] if geo.origin or found else ["poses.csv", "trees.csv", "trees.geojson", "detections.csv", *TRUTHS]
    there = [name for name in names if (folder / name).exists()]
    found += [(name, origin) for name in there if (origin := find_map_origin(folder / name, name, geo))]
    if geo.origin is None and found:
        geo = replace(geo, origin=found[0][1])
        return geo, [tell_origin(geo, f", the middle of {found[0][0]}")]
    return geo, [tell_origin(geo)] if geo.origin else []


def _find_fixes(log: DroneLog) -> Array:
    """Latitudes and longitudes (N, 2) deg of a log on the map; none are 0, 0."""
    fixed = np.isfinite(log.places).all(axis=1) & (log.places != 0).any(axis=1) & (np.abs(log.places[:, 0]) < 90)
    return np.asarray(log.places[fixed & log.on_map])


def read_logs(
    folder: Path, logs: Mapping[int, DroneLog], cameras: dict[int, LoggedCamera], geo: Geo, ground: Terrain
) -> BagFlight:
    """Cameras and poses by UAV; `cameras` are empty if there is no `cameras.csv`."""
    told = list[str]()
    sizes = _check_videos(find_videos(folder), logs, cameras)
    if not cameras:
        cameras, told = _guess_cameras(logs, sizes, folder / "cameras.csv")
    if odd := sorted({*logs} - {*cameras}):
        names = ", ".join(one.path.name for one in logs.values())
        hint = "a UAV has one log, and uav1.SRT is of UAV 1"
        raise InputError(f"FLIGHT: {folder}: logs are {names}, but no camera of {list_numbers('UAV', odd)}; {hint}")
    since_1970 = _count_since_1970(folder, geo)
    made = {i: _make_poses(one, cameras[i], geo, ground, since_1970=since_1970) for i, one in logs.items()}
    told += [remark for _, remarks, _ in made.values() for remark in remarks]
    turned = {i: camera._replace(axes="") for i, camera in cameras.items()}
    epochs = [epoch for *_, epoch in made.values()]
    return BagFlight(turned, {i: log for i, (log, *_) in made.items()}, {}, told, epochs[0], longer=True)


def _check_videos(
    videos: Mapping[int, Path], logs: Mapping[int, DroneLog], cameras: Mapping[int, LoggedCamera]
) -> dict[int, tuple[int, int]]:
    """Width and height of each video's images; InputError if one is not as long as its log, which has no offset."""
    from sim.exchange.images import measure_video  # here, as only images need OpenCV

    sizes = {}
    for i, path in videos.items():
        length, sizes[i] = measure_video(path)
        film = logs[i].film if i in logs else None
        if not film or not length or (i in cameras and "pose_offset_s" in cameras[i].given):
            continue
        if abs(length - (film[1] - film[0])) > max(_SHORT, _SHORT_SHARE * length):
            lasts = f"lasts {spell(length, 4)} s, but {logs[i].path.name} tells of {spell(film[1] - film[0], 4)} s"
            hint = "if they belong together, pose_offset_s in cameras.csv is what to add to the log's times"
            raise InputError(f"video: {path}: {lasts}; {hint}")
    return sizes


def _guess_cameras(
    logs: Mapping[int, DroneLog], sizes: Mapping[int, tuple[int, int]], file: Path
) -> tuple[dict[int, LoggedCamera], list[str]]:
    """Cameras by the focal lengths that logs tell, for the images of videos; InputError if a log tells none."""
    cameras, told = {}, []
    for i, one in logs.items():
        if math.isnan(one.focal) or i not in sizes:
            asked = "give it with the columns uav,hfov_deg,width_px,height_px: angle of view and size of images"
            lacks = f"{file} is missing, and {one.path.name} tells no focal length of a video"
            raise InputError(f"cameras: {lacks}; {asked}")
        hfov = round(math.degrees(2 * math.atan(_FILM / 2 / one.focal)), 2)
        view = {"width": sizes[i][0], "height": sizes[i][1], "hfov_deg": hfov}
        cameras[i] = make_calibrated_camera(read_settings(view, CameraSettings))
        focal = f"{spell(one.focal, 4)} mm in {one.path.name}, as of 35 mm film and a sensor of 4:3"
        told.append(f"cameras: UAV {i} sees {hfov:.1f} deg across, by {focal}; cameras.csv gives what was calibrated")
    return cameras, told


def _count_since_1970(folder: Path, geo: Geo) -> bool:
    """True if times of frames are since 1970, not since the start of a video or log."""
    for name in ("detections", "images"):
        if (path := folder / f"{name}.csv").exists():
            row = next(read_csv(path, name, ("time_s",), spares=KNOWN[name], geo=geo), None)
            return row is not None and row.time("time_s") > YEARS
    return False


def _make_poses(
    log: DroneLog, camera: LoggedCamera, geo: Geo, ground: Terrain, *, since_1970: bool
) -> tuple[PoseLog, list[str], float]:
    """Poses of the camera of a log, remarks on what is taken for granted, and `epoch` as of `BagFlight`.

    since_1970: True if the times of frames are. InputError says what the log lacks.
    """
    where = f"log: {log.path}"
    heights, above = _find_heights(log, camera.given, ground, where)
    quaternions, looks = _find_attitudes(log, camera, where)
    fixed = np.isfinite(log.places).all(axis=1) & ((log.places != 0).any(axis=1) | (not log.on_map))
    kept = fixed & np.isfinite(heights) & np.isfinite(quaternions).all(axis=1) & np.isfinite(log.times)
    latest = np.maximum.accumulate(log.times[kept])
    kept[np.flatnonzero(kept)[1:]] = log.times[kept][1:] > latest[:-1]
    if not kept.any():
        raise InputError(f"{where}: has no place with a time, a height and an attitude")
    times, clock, offset = log.times[kept], "", camera.given.get("pose_offset_s", 0.0)
    told = [f"{where}: {log.format}, {len(times)} poses from {spell(times[0])} to {spell(times[-1])} s", *log.remarks]
    if lost := len(kept) - len(times):
        lacking = "without a place, a height, an attitude or a later time"
        told.append(f"{where}: left out: {lost} of {len(kept)} rows, {lacking}")
    if since_1970:
        if math.isnan(log.epoch):
            raise InputError(f"{where}: tells no date; count the times of frames from its start")
        offset += log.epoch
        clock = "its clock is taken to be of UTC; pose_offset_s in cameras.csv says otherwise" * ("SRT" in log.format)
    elif log.film and log.film[0]:
        offset -= log.film[0]
        clock = f"its video begins at {spell(log.film[0])} s; times of frames count from there"
    told += [f"{where}: {what}" for what in (above, looks, clock) if what]
    places = geo.find_metres(*log.places[kept].T) if log.on_map else log.places[kept]
    far = np.abs(places).max(axis=1)
    if log.on_map and not (far.max() <= FARTHEST and np.abs(log.places[kept, 0]).max() <= 90):
        try:
            geo.place(*log.places[kept][far.argmax()].tolist())
        except ValueError as error:
            raise InputError(f"{where}: {error}") from error
    heights = heights[kept]
    if log.above != "ground" and "height_m" not in camera.given:
        below = ground.find_heights(places, log.path.name)
        heights = heights - (below if log.above == "sea" else below - below[0])
    poses = PoseLog(times + offset, np.column_stack([places, heights, quaternions[kept]]))
    return poses, told, log.epoch - offset


def _find_heights(log: DroneLog, given: Mapping[str, float], ground: Terrain, where: str) -> tuple[Array, str]:
    """Heights (N,) m above what the log counts from, or given ones, and what is taken for granted."""
    if "height_m" in given:
        return np.full(len(log.times), given["height_m"]), ""
    if np.isnan(log.heights).all():
        raise InputError(f"{where}: has no heights; give cameras.csv a column height_m, above the ground")
    if log.above == "start":
        level = "on the level of all ground" if ground.surface is None else "on the ground at its first place"
        return log.heights, f"heights are above the start, which is taken to be {level}"
    if log.above == "ground":
        return log.heights, "heights are taken to be above the ground"
    if not ground.is_known:
        least, usual = (spell(float(f(log.heights)), 4) for f in (np.nanmin, np.nanmedian))
        asked = f"--set geo.ground=G, of the ground above the sea; they are {usual} m in the median, {least} m at least"
        raise InputError(f"{where}: has no heights above the start, but above the sea; give {asked}; or ground.file")
    level = f"the ground is at {ground.height:g} m (geo.ground)" if ground.height is not None else "the ground likewise"
    return log.heights, f"heights are above the sea, and {level}"


def _find_attitudes(log: DroneLog, camera: LoggedCamera, where: str) -> tuple[Array, str]:
    """Attitudes (N, 4) of images, and what is taken for granted; angles in `cameras.csv` count first."""
    angles = log.attitudes
    if angles.shape[1] == 4:
        quaternions = turn(angles, log.axes if camera.axes == "image" else camera.axes)
        if "pitch_deg" not in camera.given:
            return quaternions, _TAKEN.get(log.axes, "") if camera.axes == "image" else ""
        east, north, _ = Rotation.from_quat(quaternions).apply([0.0, 1.0, 0.0]).T
        angles = np.column_stack([np.degrees(np.arctan2(east, north)), np.full((len(east), 2), math.nan)])
    columns = np.array([camera.given.get(name, math.nan) for name in ANGLES])
    angles = np.where(np.isnan(columns), angles, columns)
    lacking = [name for name, values in zip(ANGLES[:2], angles.T, strict=False) if np.isnan(values).all()]
    if lacking:
        meant = "yaw clockwise from north, pitch -90 straight down"
        asked = f"give cameras.csv the column{'s' * (len(lacking) > 1)} {' and '.join(lacking)} ({meant})"
        raise InputError(f"{where}: has no angles of a gimbal; {asked}, or poses in poses.csv")
    angles[:, 2] = np.nan_to_num(angles[:, 2])
    return find_attitudes(angles), ""
