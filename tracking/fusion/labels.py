"""Labels of tracks that differ between all tracks of a fleet, agreed without a server."""

from __future__ import annotations

import numpy as np

from tracking.numerics.arrays import Flags, Indices

LABELS_PER_SCAN = 1_000  # of one UAV: the first half for new tracks, the second for aliases
UAVS = 1_000
FIRST_LABEL = LABELS_PER_SCAN * UAVS  # labels of initial tracks are below


def new_label(scan: int, uav: int, counter: int) -> int:
    """Label that no other new track of the fleet can have; older tracks have smaller labels."""
    return (scan * UAVS + uav) * LABELS_PER_SCAN + counter


def is_new_label(ids: Indices, scan: int) -> Flags:
    """Flags (T,) of ids given to new tracks of a scan, rather than as aliases in it."""
    return np.asarray((ids >= new_label(scan, 0, 0)) & (ids % LABELS_PER_SCAN < LABELS_PER_SCAN // 2))


def aliases_of(ids: Indices, lost: Indices, scan: int, leader: int) -> Indices:
    """Aliases (T,) of tracks in a partition of the fleet with UAV `leader`, from ids (T,) and the rows of lost tracks.

    New tracks of this scan have unique ids, which are their aliases, too. The other tracks take labels that no new
    track has, counted from the end of the leader's. Lost tracks have alias 0.
    """
    rank = np.arange(len(ids))
    aliases = np.where(is_new_label(ids, scan), ids, new_label(scan, leader, LABELS_PER_SCAN - 1) - rank)
    aliases[lost] = 0
    return aliases
