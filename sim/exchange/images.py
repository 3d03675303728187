"""Images of a flight, in which a detector finds people."""

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.exchange.flight_tables import CameraFrames, CameraRow, Detection, LoggedFrame, Poses, read_uav
from sim.scenario.csv_tables import TableRow, read_csv
from sim.scenario.sensing import DETECTORS, make_detectors
from sim.scenario.text_files import read_bytes
from sim.scenario.uavs import UavSettings
from sim.sensing.sensor_output_check import check_detections
from tracking.detection.detector import Frame
from tracking.errors import InputError
from tracking.geometry.camera import Pose
from tracking.geometry.quaternions import interpolate_poses
from tracking.geometry.visibility import Forest
from tracking.settings import read_settings


def detect_in_images(
    path: Path, name: str, cameras: Mapping[int, CameraRow], poses: Mapping[int, Poses], forest: Forest
) -> dict[int, CameraFrames]:
    """Frames of each UAV, from a CSV file with the columns time_s, uav and file, an image, by the detector `name`.

    The detector gets the images in order of time. InputError names a wrong row.
    """
    found: defaultdict[int, list[LoggedFrame]] = defaultdict(list)
    sizes: dict[int, tuple[int, int]] = {}
    detectors = make_detectors(name, forest, cameras, np.random.default_rng(0))
    for row in sorted(read_csv(path, "images", ("time_s", "file")), key=lambda row: row.number("time_s")):
        uav, time = read_uav(row), row.number("time_s")
        if uav not in cameras or uav not in poses:
            raise row.error("uav", f"UAV {uav} has no camera, or no poses")
        image = _read_image(path.parent / row.text("file"), row)
        size = (image.shape[1], image.shape[0])
        if sizes.setdefault(uav, size) != size:
            raise row.error("file", f"has another size than earlier images of UAV {uav}; expected one")
        camera, log = cameras[uav].fit(size, row.where), poses[uav]
        ((*place, x, y, z, w),) = interpolate_poses(log.times, log.rows, np.clip([time], *log.times[[0, -1]])).tolist()
        pose = Pose(np.array(place), np.array([x, y, z, w]))
        optics = read_settings({"start": (0.0, 0.0), **camera.view}, UavSettings).complete().true_camera
        frame = Frame(uav, time, optics, pose, image)
        with DETECTORS.errors(name, "detect people in an image", detectors[uav], "detect"):
            told = check_detections(detectors[uav].detect(frame))
        rows = zip(told.pixels.tolist(), told.ground.tolist(), told.covariances.tolist(), strict=True)
        detections = [Detection((x, y), (R[0][0], R[0][1], R[1][1]), (u, v)) for (u, v), (x, y), R in rows]
        found[uav].append(LoggedFrame(time, row.where, detections))
    if not found:
        raise InputError(f"images: {path}: lists no image")
    return {uav: CameraFrames(frames, size=sizes[uav]) for uav, frames in found.items()}


def _read_image(path: Path, row: TableRow) -> NDArray[np.uint8]:
    """An image (H, W, 3) RGB."""
    found = cv2.imdecode(np.frombuffer(read_bytes(path, row.where), dtype=np.uint8), cv2.IMREAD_COLOR)
    if found is None:
        raise row.error("file", f"{path} is no image that can be read")
    return np.ascontiguousarray(found[..., ::-1], dtype=np.uint8)
