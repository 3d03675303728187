"""Detections in COCO's format of results, in images that a dataset of COCO lists with their times."""

from collections import defaultdict
from pathlib import Path
from typing import TypeVar

import msgspec

from sim.exchange.flight_tables import CameraFrames, Detection, LoggedFrame
from sim.scenario.text_files import read_bytes
from tracking.errors import InputError, one_line

IMAGES, RESULTS = "images.json", "results.json"
_Read = TypeVar("_Read")


class _Image(msgspec.Struct):
    id: int
    time_s: float
    width: int
    height: int
    uav: int = 0


class _Dataset(msgspec.Struct):
    images: list[_Image]


class _Result(msgspec.Struct):
    image_id: int
    bbox: tuple[float, float, float, float]  # left, top, width and height, in pixels from the top left corner


def read_coco(folder: Path) -> dict[int, CameraFrames]:
    """Frames of each UAV: boxes of `results.json` in the images of `images.json`; InputError says what to change.

    Each image has the entry time_s and, of a fleet, uav beside those of COCO. Scores and categories are not used.
    """
    images = _read(folder / IMAGES, _Dataset).images
    boxes: defaultdict[int, list[Detection]] = defaultdict(list)
    for result in _read(folder / RESULTS, list[_Result]):
        left, top, width, height = result.bbox
        boxes[result.image_id].append(Detection(pixel=(left + width / 2, top + height / 2)))
    if odd := sorted(boxes.keys() - {image.id for image in images}):
        raise InputError(f"detections: {folder / RESULTS}: image_id {odd[0]} is not in {IMAGES}")
    found: defaultdict[int, list[LoggedFrame]] = defaultdict(list)
    sizes: dict[int, tuple[int, int]] = {}
    for image in sorted(images, key=lambda image: image.time_s):
        where = f"detections: {folder / IMAGES}, image {image.id}"
        size = (image.width, image.height)
        if sizes.setdefault(image.uav, size) != size:
            raise InputError(f"{where}: has another size than earlier images of UAV {image.uav}; expected one")
        found[image.uav].append(LoggedFrame(image.time_s, where, boxes[image.id]))
    return {uav: CameraFrames(frames, size=sizes[uav]) for uav, frames in found.items()}


def _read(path: Path, kind: type[_Read]) -> _Read:
    try:
        return msgspec.json.decode(read_bytes(path, "detections"), type=kind)
    except msgspec.MsgspecError as error:
        raise InputError(f"detections: {path}: {one_line(error)}") from error
