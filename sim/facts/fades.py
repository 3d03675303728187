"""Why tracks fade: what the cameras saw at a track's place after its last detection."""

import math
from collections import Counter

import numpy as np

from sim.facts.sightings import find_inside_and_hiding
from sim.mission.recording import Recording
from sim.sensing.cameras import view_of
from tracking.errors import list_numbers
from tracking.numerics.arrays import Array

_OUT, _IN_VIEW = "out of view", "in view but not detected"


def tell_fade(recording: Recording, id_: int, last: int) -> str:
    """The frames since a track's last detection, until its last scan, in words; empty if that detected it, or unknown.

    The place of the track's mean decides what a frame could show.
    """
    rows = np.flatnonzero(recording.track_ids == id_)
    scans, _ = recording.cells(recording.track_offsets)
    _, first = np.unique(scans[rows], return_index=True)
    rows = rows[first]  # that of the first UAV at each scan
    held = dict(zip(scans[rows].tolist(), recording.track_means[rows, :2], strict=True))
    since = float(recording.track_sightings[rows[scans[rows] <= last][-1], 2])
    if math.isnan(since):
        return ""
    parts, away = [], []
    for i in range(recording.uav_count):
        taken = np.flatnonzero(recording.frames_taken[: last + 1, i] & (recording.times[: last + 1] > since + 1e-9))
        states = Counter(_name_state(recording, k, i, held) for k in taken.tolist() if k in held)
        frames = sum(states.values())
        if frames and states.pop(_OUT, 0) == frames:
            away.append(i)
        for n, (state, count) in enumerate(states.most_common()):
            parts.append(f"{state} in {count}" if n else f"for UAV {i} {state} in {count} of {frames} frames")
    if away:
        parts.append(f"out of view of {list_numbers('UAV', away)}")
    return f"no sure detection since {since:.1f} s, " + ", ".join(parts) if parts else ""


def _name_state(recording: Recording, k: int, uav: int, held: dict[int, Array]) -> str:
    camera, pose = view_of(recording.setting.uavs[uav], recording.setting), recording.believed_camera_at(k, uav)
    (inside,), (hiding,) = find_inside_and_hiding(camera, pose, held[k][None], recording.hiding_forest)
    if not inside:
        return _OUT
    return f"hidden by tree {hiding.argmax()}" if hiding.any() and hiding.max() >= 0.5 else _IN_VIEW
