"""Labelled images, from which detectors learn: frames of missions with the people in them, as COCO or YOLO."""

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sim.facts.rerender import Rerenderer
from sim.mission.atomic_files import make_new_folder
from sim.mission.recording import Recording
from sim.views.frames.frame_panels import encode_png
from tracking.geometry.camera import Camera
from tracking.numerics.arrays import Flags

SPLITS = ("train", "val", "test")
_PERSON = 1  # category in COCO


class ShownPerson(NamedTuple):
    """A person who shows by a pixel or more in an image."""

    person: int
    mask: Flags  # (H, W)
    box: tuple[int, int, int, int]  # left, top, width and height around the mask, in pixels from the top left corner
    visible_share: float  # pixels shown over those that the image would show if nothing hid the person


@dataclass(frozen=True, eq=False)
class LabelledImage:
    """An image of a flight, with the people whom it shows."""

    split: str
    flight: int  # number of the flight in the data set
    recording: Recording
    k: int  # scan
    uav: int
    people: list[ShownPerson]

    @property
    def camera(self) -> Camera:
        """The camera that took it."""
        return self.recording.setting.uavs[self.uav].true_camera

    @property
    def name(self) -> str:
        """Name of its files, without an ending."""
        return f"flight{self.flight:04d}-uav{self.uav}-scan{self.k:05d}"


def write_labelled_images(
    recordings: Iterable[Recording], target: str, out: Path, *, splits: Mapping[int, str], every: float = 0.0
) -> None:
    """Write a data set of images that are rendered again into the new folder `out`, completely or not at all.

    target: one of `LABELS`. splits: that of each seed whose images are not to be learned from, as `val` or `test`.
    every: least time [s] between two images of one camera.
    """
    with make_new_folder(out) as folder:
        LABELS[target](_write_images(recordings, folder, splits, every), folder)


def _write_images(
    recordings: Iterable[Recording], folder: Path, splits: Mapping[int, str], every: float
) -> Iterator[LabelledImage]:
    """Write images, and yield their labels."""
    for flight, recording in enumerate(recordings):
        split = splits.get(recording.seed, SPLITS[0])
        place = folder / "images" / split
        place.mkdir(parents=True, exist_ok=True)
        with Rerenderer(recording) as again:
            for k, uav in _choose_frames(recording, every):
                view, people = again.rendered(k, uav), []
                for m in np.unique(view.people[view.people >= 0]).tolist():
                    mask = view.people == m
                    shown = int(mask.sum())
                    whole = max(shown, again.count_whole(k, uav, m))  # OpenGL may show a pixel more
                    people.append(ShownPerson(m, mask, _find_box(mask), shown / whole))
                labelled = LabelledImage(split, flight, recording, k, uav, people)
                (place / f"{labelled.name}.png").write_bytes(encode_png(view.image))
                yield labelled


def _choose_frames(recording: Recording, every: float) -> list[tuple[int, int]]:
    """Scan and UAV of each frame to label, in order of time."""
    chosen = []
    for uav in range(recording.uav_count):
        due = 0.0
        for k in np.flatnonzero(recording.frames_taken[:, uav]).tolist():
            if recording.times[k] >= due - 1e-9:
                chosen.append((k, uav))
                due = float(recording.times[k]) + every
    return sorted(chosen)


def _find_box(mask: Flags) -> tuple[int, int, int, int]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    left, top = int(columns[0]), int(rows[0])
    return left, top, int(columns[-1]) + 1 - left, int(rows[-1]) + 1 - top


def _write_coco(images: Iterable[LabelledImage], folder: Path) -> None:
    """A file `annotations/instances_SPLIT.json` for each split, with images, annotations and flights."""
    sets: defaultdict[str, dict[str, list[dict[str, Any]]]] = defaultdict(lambda: defaultdict(list))
    numbers, ids = count(1), count(1)  # from 1, as tools take 0 for none
    for labelled in images:
        dataset, image = sets[labelled.split], next(numbers)
        if labelled.flight not in [flight["id"] for flight in dataset["flights"][-1:]]:
            dataset["flights"].append(_describe_flight(labelled.flight, labelled.recording))
        dataset["images"].append({"id": image, **_describe_image(labelled)})
        for shown in labelled.people:
            place = labelled.recording.people[labelled.k, shown.person].tolist()
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
                    "place_m": place,
                }
            )
    (folder / "annotations").mkdir()
    for split, dataset in sets.items():
        whole = {"categories": [{"id": _PERSON, "name": "person"}], "annotations": [], **dataset}
        (folder / "annotations" / f"instances_{split}.json").write_text(json.dumps(whole), encoding="utf-8")


def _describe_flight(number: int, recording: Recording) -> dict[str, Any]:
    names = ("seed", "repeat", "planner")
    return {"id": number, **{n: getattr(recording, n) for n in names}, "scenario": json.loads(recording.scenario)}


def _describe_image(labelled: LabelledImage) -> dict[str, Any]:
    recording, (width, height) = labelled.recording, labelled.camera.size
    optics, pose = labelled.camera.optics._asdict(), recording.camera_at(labelled.k, labelled.uav)
    return {
        "file_name": f"{labelled.name}.png",
        "width": width,
        "height": height,
        "flight": labelled.flight,
        "uav": labelled.uav,
        "time_s": float(recording.times[labelled.k]),
        "intrinsics": {name: optics[name] for name in ("fx", "fy", "cx", "cy", "distortion")},
        "pose": {"position_m": pose.position.tolist(), "quaternion_xyzw": pose.quaternion.tolist()},
    }


def _encode_runs(mask: Flags) -> list[int]:
    """Lengths of the runs of a mask by columns, False and True in turn, False first: COCO's uncompressed RLE."""
    flat = mask.ravel(order="F")
    ends = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    return [*[0] * bool(flat[0]), *np.diff([0, *ends.tolist(), len(flat)]).tolist()]


def _write_yolo(images: Iterable[LabelledImage], folder: Path) -> None:
    """A file `labels/SPLIT/NAME.txt` for each image, and `data.yaml`."""
    found = set()
    for labelled in images:
        place = folder / "labels" / labelled.split
        place.mkdir(parents=True, exist_ok=True)
        (place / f"{labelled.name}.txt").write_text("".join(_list_yolo_lines(labelled)), encoding="utf-8")
        found.add(labelled.split)
    lines = [f"{split}: images/{split}\n" for split in SPLITS if split in found]
    (folder / "data.yaml").write_text("".join([*lines, "names:\n  0: person\n"]), encoding="utf-8")


def _list_yolo_lines(labelled: LabelledImage) -> Iterator[str]:
    """Class, centre, width and height of each box, in shares of the image."""
    for _, _, (left, top, width, height), _ in labelled.people:
        box = np.array([left + width / 2, top + height / 2, width, height]) / (2 * labelled.camera.size)
        yield " ".join(["0", *(f"{part:.6f}" for part in box)]) + "\n"


LABELS: dict[str, Callable[[Iterable[LabelledImage], Path], None]] = {"coco": _write_coco, "yolo": _write_yolo}
