"""Images and videos of a flight, in which a detector finds people."""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from sim.exchange.csv_files import KNOWN, read_uav
from sim.exchange.values import CameraFrames, LoggedDetection, LoggedFrame, LoggedUav
from sim.scenario.csv_tables import TableRow, read_csv
from sim.scenario.sensing import DETECTORS, make_detectors
from sim.scenario.text_files import read_bytes
from sim.scenario.uavs import UavSettings
from sim.sensing.sensor_output_check import check_detections
from tracking.detection.detector import Frame
from tracking.errors import InputError, list_numbers, one_line
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest
from tracking.settings import read_settings

VIDEO_RATE = 5  # frames of a second of a video that are used
_EARLY = 0.1  # of the time between these, by which one may be early


_Shots = Iterable[tuple[int, float, str, NDArray[Any]]]  # UAVs, times [s], files and places in them, and images


def detect_in_images(path: Path, name: str, uavs: Mapping[int, LoggedUav], forest: Forest) -> dict[int, CameraFrames]:
    """Frames of each UAV, from a CSV file with the columns time_s, uav and file, an image, by the detector `name`.

    The detector gets the images in order of time. InputError names a wrong row.
    """
    found = _detect(_list_images(path, uavs), name, uavs, forest)
    if not found:
        raise InputError(f"images: {path}: lists no image")
    return found


def detect_in_videos(
    paths: Mapping[int, Path], name: str, uavs: Mapping[int, LoggedUav], forest: Forest
) -> dict[int, CameraFrames]:
    """Frames of the video of each UAV, `VIDEO_RATE` of them in a second, by the detector `name`."""
    found: dict[int, CameraFrames] = {}
    for uav, path in paths.items():
        measure_video(path)
        found |= _detect(_list_frames(uav, path), name, uavs, forest)
        told = f"video: {path}: {len(found[uav].frames)} frames, {VIDEO_RATE} in a second, are used"
        found[uav] = found[uav]._replace(remarks=(*found[uav].remarks, told))
    return found


def measure_video(path: Path) -> tuple[float, tuple[int, int]]:
    """Length [s] of a video, and the width and height of its images; InputError if it is none."""
    try:
        with av.open(str(path)) as video:
            stream = video.streams.video[0]
            return float((stream.duration or 0) * (stream.time_base or 0)), (stream.width, stream.height)
    except (av.FFmpegError, OSError, IndexError) as error:
        raise InputError(f"video: {path}: is no video that can be read: {one_line(error)}") from error


def _list_frames(uav: int, path: Path) -> _Shots:
    """Frames of a video at the times of scans, by its own clock."""
    due = 0
    with av.open(str(path)) as video:
        for frame in video.decode(video=0):
            if frame.time is not None and frame.time * VIDEO_RATE >= due - _EARLY:
                due = math.floor(frame.time * VIDEO_RATE + _EARLY) + 1
                yield uav, frame.time, f"video: {path}, {frame.time:.3f} s", frame.to_ndarray(format="rgb24")


def _list_images(path: Path, uavs: Mapping[int, LoggedUav]) -> _Shots:
    """Images of a table in order of time."""
    rows = read_csv(path, "images", ("time_s", "file"), spares=KNOWN["images"])
    for row in sorted(rows, key=lambda row: row.time("time_s")):
        if (uav := read_uav(row)) not in uavs:
            raise row.error("uav", f"UAV {uav} has no camera, or no poses")
        yield uav, row.time("time_s"), row.where, _read_image(path.parent / row.text("file"), row)


def _detect(shots: _Shots, name: str, uavs: Mapping[int, LoggedUav], forest: Forest) -> dict[int, CameraFrames]:
    """Frames of each UAV by the detector `name`, which gets images in their order."""
    found: defaultdict[int, list[LoggedFrame]] = defaultdict(list)
    sizes: dict[int, tuple[int, int]] = {}
    deep = set[int]()  # UAVs whose images have more than 8 bits
    detectors = make_detectors(name, uavs, np.random.default_rng(0))
    for uav, time, where, image in shots:
        if image.dtype != np.uint8:
            deep.add(uav)
            image = _stretch(image)
        size = (image.shape[1], image.shape[0])
        if sizes.setdefault(uav, size) != size:
            raise InputError(f"{where}: has another size than earlier images of UAV {uav}; expected one")
        camera = uavs[uav].camera.fit(size, where)
        (at,) = uavs[uav].poses.at(np.array([time]))
        optics = read_settings({"start": (0.0, 0.0), **camera.view}, UavSettings).complete().true_camera
        frame = Frame(uav, time, optics, Pose(at[:3], at[3:]), image, forest)
        with DETECTORS.errors(name, "detect people in an image", detectors[uav], "detect"):
            told = check_detections(detectors[uav].detect(frame))
        rows = zip(told.pixels.tolist(), told.ground.tolist(), told.covariances.tolist(), strict=True)
        detections = [LoggedDetection((x, y), (R[0][0], R[0][1], R[1][1]), (u, v)) for (u, v), (x, y), R in rows]
        found[uav].append(LoggedFrame(time, where, detections))
    made = {uav: CameraFrames(frames, size=sizes[uav]) for uav, frames in found.items()}
    if deep:
        stretched = "have more than 8 bits: in each, the darkest value becomes 0 and the brightest 255"
        remark = f"images: those of {list_numbers('UAV', sorted(deep))} {stretched}"
        made[min(deep)] = made[min(deep)]._replace(remarks=(remark,))
    return made


def _read_image(path: Path, row: TableRow) -> NDArray[Any]:
    """An image (H, W, 3) RGB, with as many bits as it has."""
    content = np.frombuffer(read_bytes(path, row.where), dtype=np.uint8)
    found = cv2.imdecode(content, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    if found is None:
        raise row.error("file", f"{path} is no image that can be read")
    return np.ascontiguousarray(found[..., ::-1])


def _stretch(image: NDArray[Any]) -> NDArray[np.uint8]:
    """An image of 8 bits, whose darkest value is 0 and whose brightest is 255."""
    ends = (np.nanmin(image), np.nanmax(image))
    return np.asarray(np.rint(np.nan_to_num(np.interp(image, ends, (0.0, 255.0)))), dtype=np.uint8)
