"""Images of a flight, in which a detector finds people."""

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.exchange.csv_files import read_uav
from sim.exchange.values import CameraFrames, LoggedDetection, LoggedFrame, LoggedUav
from sim.scenario.csv_tables import TableRow, read_csv
from sim.scenario.sensing import DETECTORS, make_detectors
from sim.scenario.text_files import read_bytes
from sim.scenario.uavs import UavSettings
from sim.sensing.sensor_output_check import check_detections
from tracking.detection.detector import Frame
from tracking.errors import InputError
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest
from tracking.settings import read_settings


def detect_in_images(path: Path, name: str, uavs: Mapping[int, LoggedUav], forest: Forest) -> dict[int, CameraFrames]:
    """Frames of each UAV, from a CSV file with the columns time_s, uav and file, an image, by the detector `name`.

    The detector gets the images in order of time. InputError names a wrong row.
    """
    found: defaultdict[int, list[LoggedFrame]] = defaultdict(list)
    sizes: dict[int, tuple[int, int]] = {}
    detectors = make_detectors(name, forest, uavs, np.random.default_rng(0))
    for row in sorted(read_csv(path, "images", ("time_s", "file")), key=lambda row: row.number("time_s")):
        uav, time = read_uav(row), row.number("time_s")
        if uav not in uavs:
            raise row.error("uav", f"UAV {uav} has no camera, or no poses")
        image = _read_image(path.parent / row.text("file"), row)
        size = (image.shape[1], image.shape[0])
        if sizes.setdefault(uav, size) != size:
            raise row.error("file", f"has another size than earlier images of UAV {uav}; expected one")
        camera = uavs[uav].camera.fit(size, row.where)
        (at,) = uavs[uav].poses.at(np.array([time]))
        optics = read_settings({"start": (0.0, 0.0), **camera.view}, UavSettings).complete().true_camera
        frame = Frame(uav, time, optics, Pose(at[:3], at[3:]), image)
        with DETECTORS.errors(name, "detect people in an image", detectors[uav], "detect"):
            told = check_detections(detectors[uav].detect(frame))
        rows = zip(told.pixels.tolist(), told.ground.tolist(), told.covariances.tolist(), strict=True)
        detections = [LoggedDetection((x, y), (R[0][0], R[0][1], R[1][1]), (u, v)) for (u, v), (x, y), R in rows]
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
