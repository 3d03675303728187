"""Trees mapped from frames, of a flight or of one's own, and as a stem map."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import astuple
from pathlib import Path

import numpy as np

from sim.exchange.csv_files import write_table
from sim.facts.rerender import Rerenderer
from sim.mission.recording import Recording
from sim.scenario.believed import MAPPERS
from sim.world.stem_map import TREE_COLUMNS
from tracking.detection.detector import Frame
from tracking.errors import InputError
from tracking.mapping.mapper import MappedTree

_DEVIATIONS = ("x", "y", "canopy_radius", "canopy_base", "canopy_top")  # columns in the order of covariances


def list_frames(recording: Recording, uav: int) -> Iterator[Frame]:
    """The frames of a UAV's camera, rendered again, as the UAV believes them to be taken; InputError if it has none."""
    if recording.frames is not None:
        raise InputError("frames: the flight was not flown here, so its images cannot be rendered; give frames")
    if not 0 <= uav < recording.uav_count:
        raise InputError(f"uav: {uav} is not allowed; expected 0 to {recording.uav_count - 1}")
    camera = recording.setting.believed_camera(uav)
    with Rerenderer(recording) as rendered:
        for k in np.flatnonzero(recording.frames_taken[:, uav]).tolist():
            pose = recording.believed_camera_at(k, uav)
            yield Frame(uav, float(recording.times[k]), camera, pose, rendered.image(k, uav))


def map_frames(frames: Iterable[Frame], mapper: str) -> tuple[MappedTree, ...]:
    """Trees that a mapper, by name or import string, finds in the frames of one camera."""
    made = MAPPERS.make(mapper)
    with MAPPERS.errors(mapper, "map", made, "add"):
        for frame in frames:
            made.add(frame)
        return tuple(made.trees())


def write_stem_map(trees: Iterable[MappedTree], path: Path) -> None:
    """Write trees as a stem map, with deviations [m] and probabilities of existence in further columns."""
    header = *TREE_COLUMNS[:6], *(f"{name}_deviation_m" for name in _DEVIATIONS), "existence"
    rows = ([*astuple(m.tree)[:6], *map(math.sqrt, np.diag(m.covariance).tolist()), m.existence] for m in trees)
    write_table(path, header, rows)
