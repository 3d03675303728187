"""People in images: COCO's results are read as detections, and labels are written as COCO and YOLO have them."""

import json
import math
from collections import defaultdict
from collections.abc import Iterable
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from sim.exchange.values import NOWHERE, SPLITS, CameraFrames, LabelledImage, LoggedDetection, LoggedFrame
from sim.mission.recording import Recording
from sim.scenario.text_files import read_text
from tracking.errors import InputError, one_line
from tracking.numerics.arrays import Flags

_IMAGES = "images.json"
RESULTS = "results.json"
_PERSON = 1  # category in COCO
_Read = TypeVar("_Read")


class _Image(msgspec.Struct):
    id: int
    time_s: float
    width: int
    height: int
    uav: int = 0


class _Category(msgspec.Struct):
    id: int
    name: str = ""
    supercategory: str = ""


class _Dataset(msgspec.Struct):
    images: list[_Image]
    categories: list[_Category] = []


class _Result(msgspec.Struct):
    image_id: int
    bbox: tuple[float, float, float, float]  # left, top, width and height, in pixels from the top left corner
    category_id: float | str | None = None
    score: float | None = None


def read_coco(folder: Path) -> dict[int, CameraFrames]:
    """Frames of each UAV: boxes of `results.json` in the images of `images.json`; InputError says what to change.

    Each image has the entry time_s and, of a fleet, uav beside those of COCO. `images.json` may name the categories.
    """
    dataset = _read(folder / _IMAGES, _Dataset)
    groups: defaultdict[str, set[str]] = defaultdict(set)
    for one in dataset.categories:
        groups[one.supercategory].add(one.name or str(one.id))
    images, categories = dataset.images, {str(one.id): one.name for one in dataset.categories if one.name}
    boxes: defaultdict[int, list[LoggedDetection]] = defaultdict(list)
    for result in _read(folder / RESULTS, list[_Result]):
        left, top, width, height = result.bbox
        given = result.category_id
        number = f"{given:.0f}" if isinstance(given, float) else given or ""
        pixel = (left + width / 2, top + height / 2) if width > 0 and height > 0 else NOWHERE
        score = math.nan if result.score is None else result.score
        detection = LoggedDetection(pixel=pixel, category=categories.get(number, number), score=score)
        boxes[result.image_id].append(detection)
    if odd := sorted(boxes.keys() - {image.id for image in images}):
        raise InputError(f"detections: {folder / RESULTS}: image_id {odd[0]} is not in {_IMAGES}")
    found: defaultdict[int, list[LoggedFrame]] = defaultdict(list)
    sizes: dict[int, tuple[int, int]] = {}
    for image in sorted(images, key=lambda image: image.time_s):
        where = f"detections: {folder / _IMAGES}, image {image.id}"
        size = (image.width, image.height)
        if sizes.setdefault(image.uav, size) != size:
            raise InputError(f"{where}: has another size than earlier images of UAV {image.uav}; expected one")
        found[image.uav].append(LoggedFrame(image.time_s, where, boxes[image.id]))
    return {uav: CameraFrames(own, (), sizes[uav], categories, groups) for uav, own in found.items()}


def _read(path: Path, kind: type[_Read]) -> _Read:
    try:
        return msgspec.json.decode(read_text(path, "detections"), type=kind)
    except msgspec.MsgspecError as error:
        raise InputError(f"detections: {path}: {one_line(error)}") from error


def write_coco(images: Iterable[LabelledImage], folder: Path) -> None:
    """Write a file `annotations/instances_SPLIT.json` for each split, with images, annotations and flights."""
    sets: defaultdict[str, dict[str, list[dict[str, Any]]]] = defaultdict(lambda: defaultdict(list))
    ids = count(1)  # from 1, as tools take 0 for none
    for image, labelled in enumerate(images, 1):
        dataset = sets[labelled.split]
        if labelled.flight not in [flight["id"] for flight in dataset["flights"][-1:]]:
            dataset["flights"].append(_describe_flight(labelled.flight, labelled.recording))
        dataset["images"].append({"id": image, **_describe_image(labelled)})
        for shown in labelled.people:
            dataset["annotations"].append(
                {
                    "id": next(ids),
                    "image_id": image,
                    "category_id": _PERSON,
                    "bbox": shown.box,
                    "area": int(shown.mask.sum()),
                    "segmentation": {"size": shown.mask.shape, "counts": _encode_runs(shown.mask)},
                    "iscrowd": 0,
                    "person": shown.person,
                    "visible_share": shown.visible_share,
                    "place_m": labelled.recording.people[labelled.k, shown.person].tolist(),
                }
            )
    (folder / "annotations").mkdir()
    for split, dataset in sets.items():
        about = {"info": {"description": f"Understory: images for {split}"}, "licenses": []}
        whole = {**about, "categories": [{"id": _PERSON, "name": "person"}], "annotations": [], **dataset}
        (folder / "annotations" / f"instances_{split}.json").write_text(json.dumps(whole), encoding="utf-8")


def _describe_flight(number: int, recording: Recording) -> dict[str, Any]:
    names = ("seed", "repeat", "planner")
    return {"id": number, **{n: getattr(recording, n) for n in names}, "scenario": json.loads(recording.scenario)}


def _describe_image(labelled: LabelledImage) -> dict[str, Any]:
    width, height = labelled.camera.size
    o = labelled.camera.optics
    pose = labelled.recording.camera_at(labelled.k, labelled.uav)
    return {
        "file_name": f"{labelled.name}.png",
        "width": width,
        "height": height,
        "flight": labelled.flight,
        "uav": labelled.uav,
        "time_s": float(labelled.recording.times[labelled.k]),
        "intrinsics": {"fx": o.fx, "fy": o.fy, "cx": o.cx, "cy": o.cy, **o.distortion.settings},
        "pose": {"position_m": pose.position.tolist(), "quaternion_xyzw": pose.quaternion.tolist()},
    }


def _encode_runs(mask: Flags) -> list[int]:
    """Lengths of the runs of a mask by columns, False and True in turn, False first: COCO's uncompressed RLE."""
    flat = mask.ravel(order="F")
    ends = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    return [*[0] * bool(flat[0]), *np.diff([0, *ends.tolist(), len(flat)]).tolist()]


def write_yolo(images: Iterable[LabelledImage], folder: Path) -> None:
    """Write a file `labels/SPLIT/NAME.txt` for each image, and `data.yaml`, whose tools want `train` and `val`.

    A line is a class, then centre, width and height of a box in shares of the image.
    """
    found = set()
    for labelled in images:
        lines = []
        for shown in labelled.people:
            left, top, width, height = shown.box
            edges = np.array([[left, top], [left + width, top + height]]) / labelled.camera.size
            # A seventh digit is needed for the middle of edges with six, so that the box stays inside the image.
            first, last = edges.round(6)
            lines.append(" ".join(["0", *(f"{part:.7f}" for part in (*(first + last) / 2, *last - first))]) + "\n")
        place = folder / "labels" / labelled.split
        place.mkdir(parents=True, exist_ok=True)
        (place / f"{labelled.name}.txt").write_text("".join(lines), encoding="utf-8")
        found.add(labelled.split)
    instead = min(found, key=SPLITS.index, default=SPLITS[0])
    lines = [f"{split}: images/{split}\n" for split in SPLITS if split in found]
    lines += [f"{split}: images/{instead}  # it has none of its own\n" for split in SPLITS[:2] if split not in found]
    (folder / "data.yaml").write_text("".join([*lines, "names:\n  0: person\n"]), encoding="utf-8")
