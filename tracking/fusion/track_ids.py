"""Ids of new tracks that are unique in a fleet, agreed without a server."""

from tracking.numerics.arrays import Flags, Indices

IDS_PER_SCAN = 1_000  # per UAV: the first half for new tracks, the second for tracks that lose their id to another
UAVS = 1_000
FIRST_NEW_ID = IDS_PER_SCAN * UAVS  # ids of initial tracks are smaller


def new_id(scan: int, uav: int, counter: int) -> int:
    """Id that no other new track of the fleet can have; older tracks have smaller ids."""
    return (scan * UAVS + uav) * IDS_PER_SCAN + counter


def is_new_id(ids: Indices, scan: int) -> Flags:
    """Flags (T,) of ids of tracks that began in a scan, rather than tracks that got another id in it."""
    return (ids >= new_id(scan, 0, 0)) & (ids % IDS_PER_SCAN < IDS_PER_SCAN // 2)
