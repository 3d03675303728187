"""The formats in which recordings are exported, by name: a row each; and labelled images, rendered again."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from sim.exchange.csv_files import write_csv
from sim.exchange.geojson import write_geojson
from sim.exchange.image_labels import write_coco, write_yolo
from sim.exchange.mot import write_mot
from sim.exchange.ros_mission import IMAGES, write_rosbag
from sim.exchange.tables import write_stonesoup, write_tables
from sim.exchange.values import SPLITS, LabelledImage, ShownPerson
from sim.facts.rerender import Rerenderer
from sim.mission.atomic_files import make_new_folder
from sim.mission.recording import Recording
from sim.views.frames.frame_panels import encode_png
from tracking.errors import InputError, check_known
from tracking.numerics.arrays import Flags

# What writes a recording into a folder that is new.
EXPORTS: dict[str, Callable[[Recording, Path], None]] = {
    "csv": write_csv,
    "stonesoup": write_stonesoup,
    "mot": write_mot,
    "parquet": write_tables,
    "rosbag": write_rosbag,
    "geojson": write_geojson,
}
# What writes the labels of images.
LABELS: dict[str, Callable[[Iterable[LabelledImage], Path], None]] = {"coco": write_coco, "yolo": write_yolo}


def export(recording: Recording, target: str, out: Path, *, truth: bool = True, images: str | None = None) -> None:
    """Write a recording into the new folder `out`, completely or not at all; InputError if target or folder is wrong.

    target: one of `EXPORTS`, whose files docs/how-to/tracking.md describes, with options as from `check_options`. Of a
    bag only: truth: False to leave out what UAVs do not know; images: "jpeg", the default, or "png".
    """
    check_known("--to", target, EXPORTS)
    if target == "geojson" and recording.setting.geo.origin is None:
        where = "--set geo.origin=[latitude,longitude] when it is flown or tracked gives one"
        raise InputError(f"--to: geojson needs a place on the map, which this recording has not; {where}")
    with make_new_folder(out) as folder:
        if target == "rosbag":
            write_rosbag(recording, folder, truth=truth, images=images or "jpeg")
        else:
            EXPORTS[target](recording, folder)


def check_options(target: str, *, truth: bool, images: str | None) -> None:
    """InputError if options of bags are given to another format, or are none."""
    for name, given in (("--no-truth", not truth), ("--images", images is not None)):
        if given and target != "rosbag":
            raise InputError(f"{name}: not allowed together with --to {target}; it belongs to --to rosbag")
    check_known("--images", images or "jpeg", IMAGES)


def write_labelled_images(
    recordings: Iterable[Recording], target: str, out: Path, *, splits: Mapping[int, str], every: float = 0.0
) -> None:
    """Write a data set of images of missions flown here, rendered again, completely or not at all.

    target: one of `LABELS`. splits: `val` or `test` for seeds whose images are not to be learned from. every: least
    time [s] between two images of one camera.
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
                view = again.rendered(k, uav)
                people = []
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
    columns = np.flatnonzero(mask.any(axis=0)).tolist()
    rows = np.flatnonzero(mask.any(axis=1)).tolist()
    return columns[0], rows[0], columns[-1] + 1 - columns[0], rows[-1] + 1 - rows[0]
