"""The formats in which recordings are exported, by name: a row each."""

from collections.abc import Callable, Iterable
from pathlib import Path

from sim.exchange.csv_files import write_csv
from sim.exchange.image_labels import write_coco, write_yolo
from sim.exchange.mot import write_mot
from sim.exchange.ros_mission import write_rosbag
from sim.exchange.tables import write_stonesoup, write_tables
from sim.exchange.values import LabelledImage
from sim.mission.atomic_files import make_new_folder
from sim.mission.recording import Recording
from tracking.errors import check_known

# What writes a recording into a folder that is new.
EXPORTS: dict[str, Callable[[Recording, Path], None]] = {
    "csv": write_csv,
    "stonesoup": write_stonesoup,
    "mot": write_mot,
    "parquet": write_tables,
    "rosbag": write_rosbag,
}
# What writes the labels of images.
LABELS: dict[str, Callable[[Iterable[LabelledImage], Path], None]] = {"coco": write_coco, "yolo": write_yolo}


def export(recording: Recording, target: str, out: Path, *, truth: bool = True) -> None:
    """Write a recording into the new folder `out`, completely or not at all; InputError if target or folder is wrong.

    target: one of `EXPORTS`, whose files docs/how-to/tracking.md describes. truth: False to leave out what UAVs do not
    know, of a bag.
    """
    check_known("--to", target, EXPORTS)
    with make_new_folder(out) as folder:
        if truth:
            EXPORTS[target](recording, folder)
        else:
            write_rosbag(recording, folder, truth=False)
