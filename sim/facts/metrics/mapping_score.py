"""Errors of the maps of trees that UAVs made, at the end of a mission."""

import math
from typing import NamedTuple

import numpy as np

from sim.mission.recording import Recording
from tracking.errors import list_numbers
from tracking.geometry.line_of_sight import value_at
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.assignment import pairs_within
from tracking.numerics.distances import length


class MappingScore(NamedTuple):
    """Errors of a map, or of several, of which numbers are summed."""

    seen: int  # true trees whose middle cannot be below an unknown tree, as far as the UAV believes
    found: int  # of these, mapped trees
    mapped: int  # trees on maps
    distances: Array  # (D,) m, from the middle of each mapped tree that is a true one to the true middle
    trees: Indices  # (D,): these true trees

    @property
    def error(self) -> float:
        """Root mean square of the distances [m]; NaN without any."""
        return math.sqrt(np.mean(np.square(self.distances))) if len(self.distances) else math.nan


def compare_maps(recording: Recording) -> MappingScore | None:
    """Compare the last map of each UAV with the true trees; None if UAVs made no maps.

    A mapped tree is a true one if its middle is below that one's crown; each stands for one tree at most.
    """
    if recording.maps is None:
        return None
    last = recording.scan_count - 1
    return _add([compare_map(recording.believed_at(last, i), recording.forest) for i in range(recording.uav_count)])


def tell_unmapped(recording: Recording) -> str:
    """Which of the UAVs that still work know of no ground or tree at the end, in words; empty if there are none."""
    last, unseen = recording.scan_count - 1, recording.map_unknown
    if unseen is None or recording.maps is None:
        return ""
    working = np.flatnonzero(recording.working[last]).tolist()
    uavs = [i for i in working if np.all(unseen[recording.maps[last, i]] > 0.0)]
    parallax = recording.setting.mapping.mapper == "parallax" and not recording.all_faults
    why = "; a camera that hardly moves has no parallax" if parallax else ""
    return f"{list_numbers('UAV', uavs)}: no ground or tree mapped{why}." if uavs else ""


def compare_map(believed: Forest, true: Forest) -> MappingScore:
    """Compare one map with the true trees."""
    own, exact = (np.array([(tree.x, tree.y) for tree in forest.trees]).reshape(-1, 2) for forest in (believed, true))
    gaps = length(own[:, None] - exact[None])
    radii = np.array([tree.canopy_radius for tree in true.trees])
    pairs = pairs_within(np.where(gaps < radii, gaps, np.inf), float(radii.max(initial=0.0)))
    seen = [value_at(believed.unknown_around, *place) == 0.0 for place in exact.tolist()]
    found = sum(seen[b] for _, b in pairs)
    trees = np.array([b for _, b in pairs], dtype=np.int64)
    return MappingScore(sum(seen), found, len(own), np.array([gaps[pair] for pair in pairs]), trees)


def _add(errors: list[MappingScore]) -> MappingScore:
    seen, found, mapped = (sum(column) for column in list(zip(*errors, strict=True))[:3])
    distances, trees = (np.concatenate(column) for column in list(zip(*errors, strict=True))[3:])
    return MappingScore(seen, found, mapped, distances, trees)
