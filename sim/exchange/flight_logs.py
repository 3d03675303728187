"""Logs and videos of a flight: where they are on the map, whether they belong together, and the cameras they tell."""

import math
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from sim.exchange.csv_files import KNOWN
from sim.exchange.drone_log import FoundLog, make_poses, number_files
from sim.exchange.values import LoggedCamera, PoseLog, make_calibrated_camera
from sim.scenario.camera_settings import CameraSettings
from sim.scenario.csv_tables import find_map_origin, find_middle, read_csv
from sim.scenario.geo import Geo, tell_origin
from sim.scenario.text_files import read_text
from tracking.errors import InputError, list_numbers, spell
from tracking.settings import read_settings

TRUTHS = ("truth.csv", "truth.gpx")  # files of people
VIDEOS = "*.[mM][pPoO][4vV]"  # files of videos, .mp4 and .mov
_YEARS = 1e8  # s, beyond which times are since 1970
_SHORT, _SHORT_SHARE = 1.0, 0.02  # s, and of its length, by which a video and its log may differ
_FILM = 34.6  # mm, width of a sensor of 4:3 with the corners of 35 mm film, 43.3 mm apart


def find_videos(folder: Path) -> dict[int, Path]:
    """Videos of a folder by UAV, in order of their names; of a numbered one such as uav1.mp4, its number."""
    return number_files(sorted(folder.glob(VIDEOS)))


def locate(folder: Path, geo: Geo, logs: Mapping[int, FoundLog]) -> tuple[Geo, list[str]]:
    """The map with its origin, by default in the middle of the first file with places on it, and a remark on it."""
    if geo.origin is None:
        for one in logs.values():
            fixed = one.log.places[np.isfinite(one.log.places).all(axis=1) & (one.log.places != 0).any(axis=1)]
            if one.log.on_map and len(fixed) and np.abs(fixed[:, 0]).max() < 90:
                geo = replace(geo, origin=find_middle(*fixed.T))
                return geo, [tell_origin(geo, f", the middle of {one.path.name}")]
        for name in ("poses.csv", "poses.gpx", "trees.csv", "detections.csv", *TRUTHS):
            if (folder / name).exists() and (origin := find_map_origin(folder / name, name, geo)):
                geo = replace(geo, origin=origin)
                return geo, [tell_origin(geo, f", the middle of {name}")]
    return geo, list(filter(None, [tell_origin(geo)]))


def _count_since_1970(folder: Path, geo: Geo) -> bool:
    """True if times of frames are since 1970, not since the start of a video or log."""
    for name in ("detections.csv", "images.csv"):
        if (folder / name).exists():
            row = next(
                read_csv(folder / name, name, ("time_s",), spares=KNOWN[name.removesuffix(".csv")], geo=geo), None
            )
            return row is not None and row.time("time_s") > _YEARS
    listed = folder / "images.json"
    found = re.search(r'"time_s"\s*:\s*([\d.eE+]+)', read_text(listed, "detections")) if listed.exists() else None
    return found is not None and float(found[1]) > _YEARS


def _check_videos(
    logs: Mapping[int, FoundLog], videos: Mapping[int, Path], cameras: Mapping[int, LoggedCamera]
) -> dict[int, tuple[int, int]]:
    """Width and height of each video's images; InputError if one is not as long as its log, which has no offset."""
    from sim.exchange.images import measure_video  # here, as only images need OpenCV

    sizes = {}
    for i, path in videos.items():
        length, sizes[i] = measure_video(path)
        film = logs[i].log.film if i in logs else None
        offset = i in cameras and "pose_offset_s" in cameras[i].given
        if film and length and abs(length - (film[1] - film[0])) > max(_SHORT, _SHORT_SHARE * length) and not offset:
            lasts = f"lasts {spell(length, 4)} s, but {logs[i].path.name} tells of {spell(film[1] - film[0], 4)} s"
            hint = (
                "if both belong together, the column pose_offset_s in cameras.csv says by how much its times are late"
            )
            raise InputError(f"video: {path}: {lasts}; {hint}")
    return sizes


def read_logs(
    folder: Path, logs: Mapping[int, FoundLog], cameras: dict[int, LoggedCamera], geo: Geo
) -> tuple[dict[int, LoggedCamera], dict[int, PoseLog], list[str]]:
    """Cameras and poses by UAV, and remarks; cameras are empty if there is no `cameras.csv`."""
    told = list[str]()
    sizes = _check_videos(logs, find_videos(folder), cameras)
    if not cameras:
        cameras, told = _guess_cameras(logs, sizes, folder / "cameras.csv")
    if odd := sorted({*logs} - {*cameras}):
        names = ", ".join(one.path.name for one in logs.values())
        hint = "a UAV has one log, and uav1.SRT is of UAV 1"
        raise InputError(f"FLIGHT: {folder}: logs are {names}, but no camera of {list_numbers('UAV', odd)}; {hint}")
    since_1970 = _count_since_1970(folder, geo)
    made = {i: make_poses(one, cameras[i], geo, since_1970=since_1970) for i, one in logs.items()}
    told += [remark for _, remarks in made.values() for remark in remarks]
    turned = {i: camera._replace(axes="") for i, camera in cameras.items()}
    return turned, {i: log for i, (log, _) in made.items()}, told


def _guess_cameras(
    logs: Mapping[int, FoundLog], sizes: Mapping[int, tuple[int, int]], file: Path
) -> tuple[dict[int, LoggedCamera], list[str]]:
    """Cameras by the focal lengths that logs tell, for the images of videos; InputError if a log tells none."""
    cameras, told = {}, []
    for i, one in logs.items():
        if math.isnan(one.log.focal) or i not in sizes:
            asked = "give it with the columns uav,hfov_deg,width_px,height_px: angle of view and size of images"
            raise InputError(
                f"cameras: {file} is missing, and {one.path.name} tells no focal length of a video; {asked}"
            )
        width, height = sizes[i]
        hfov = math.degrees(2 * math.atan(_FILM / 2 / one.log.focal))
        settings = read_settings({"width": width, "height": height, "hfov_deg": round(hfov, 2)}, CameraSettings)
        cameras[i] = make_calibrated_camera(settings)
        focal = f"{spell(one.log.focal, 4)} mm in {one.path.name}, as of 35 mm film and a sensor of 4:3"
        told.append(f"cameras: UAV {i} sees {hfov:.1f} deg across, by {focal}; cameras.csv gives what was calibrated")
    return cameras, told
