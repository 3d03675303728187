"""Trees that UAVs come to see, and since when others had told them of each."""

import math
from typing import NamedTuple

import numpy as np

from sim.facts.metrics.mapping_score import compare_map
from sim.mission.recording import Recording
from tracking.geometry.visibility import NO_TREES
from tracking.numerics.arrays import Array, Flags

_TURN = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)


class TreeMet(NamedTuple):
    """A tree that comes into the view of a UAV for the first time."""

    scan: int
    uav: int
    tree: int
    ahead: float  # s, for how long it has been on the UAV's map; NaN if it is not


def find_trees_met(recording: Recording) -> list[TreeMet]:
    """The trees that each UAV meets, by UAV and scan; none if UAVs do not share maps.

    A tree is met at the first frame with any part of the rims of its crown's base and top, so that what a UAV knows of
    it before is from others.
    """
    if recording.maps is None or recording.map_bytes is None:
        return []
    found = []
    for uav in range(recording.uav_count):
        seen, since = _find_seen(recording, uav), np.full(len(recording.trees), math.nan)  # s, when it came on the map
        first, met = np.argmax(seen, axis=0), seen.any(axis=0)
        for k in np.flatnonzero(recording.new_maps[:, uav] | np.isin(np.arange(len(seen)), first)).tolist():
            if recording.new_maps[k, uav]:
                on_map = np.isin(
                    np.arange(len(since)), compare_map(recording.believed_at(k, uav), recording.forest).trees
                )
                since = np.where(on_map, np.fmin(since, recording.times[k]), math.nan)
            for tree in np.flatnonzero(met & (first == k)).tolist():
                found.append(TreeMet(k, uav, tree, float(recording.times[k] - since[tree])))
    return found


def _find_seen(recording: Recording, uav: int) -> Flags:
    """Mask (K, T) of the trees of whose crown a frame of a UAV has any part of the rims in its image."""
    forest, camera = recording.forest, recording.setting.uavs[uav].true_camera
    crowns = forest.canopies[:, :5].tolist()
    rims = np.array([[_list_rim(x, y, r, z) for z in heights] for x, y, r, *heights in crowns]).reshape(-1, 3)
    poses = recording.cameras[:, uav]
    optics = np.tile(camera.optics.numbers, (len(poses), 1))
    inside = NO_TREES.find_shown(optics, poses[:, :3].copy(), poses[:, 3:].copy(), rims) > 0.0
    seen = inside.reshape(len(poses), -1, 2 * (len(_TURN) + 1)).any(axis=2)
    return np.asarray(seen & recording.frames_taken[:, uav, None])


def _list_rim(x: float, y: float, radius: float, height: float) -> Array:
    """Points (N, 3) m of the middle and the rim of a crown at a height [m]."""
    east, north = x + radius * np.append(np.cos(_TURN), 0.0), y + radius * np.append(np.sin(_TURN), 0.0)
    return np.column_stack([east, north, np.full(len(east), height)])
