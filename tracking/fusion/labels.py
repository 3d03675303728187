"""Track labels that are unique in a fleet, agreed without a server."""

from tracking.numerics.arrays import Flags, Indices

LABELS_PER_SCAN = 1_000  # per UAV: the first half for new tracks, the second for tracks that lose their id
UAVS = 1_000
FIRST_LABEL = LABELS_PER_SCAN * UAVS  # labels of initial tracks are smaller


def new_label(scan: int, uav: int, counter: int) -> int:
    """Label that no other new track of the fleet can have; older tracks have smaller labels."""
    return (scan * UAVS + uav) * LABELS_PER_SCAN + counter


def is_new_label(ids: Indices, scan: int) -> Flags:
    """Flags (T,) of ids of tracks that began in a scan, rather than tracks that got another id in it."""
    return (ids >= new_label(scan, 0, 0)) & (ids % LABELS_PER_SCAN < LABELS_PER_SCAN // 2)
