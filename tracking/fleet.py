"""One scan of a fleet of trackers: measurement updates and fusion."""

from collections.abc import Sequence

import numpy as np

from tracking.fusion.consensus import fuse
from tracking.fusion.member import Member
from tracking.numerics.arrays import Flags, Indices
from tracking.track import Scan


def step(
    fleet: Sequence[Member],
    scans: Sequence[Scan],
    adjacency: Flags | None = None,
    *,
    rounds: int = 5,
    lost: Flags | None = None,
    time: float | None = None,
) -> Indices:
    """Update trackers with their scans, predict the others to the scans' time, and fuse the tracks of all.

    The scans are of one time [s] and of different UAVs; `time` is needed if there are none. adjacency (n, n): graph of
    communication in the fleet's order; by default all UAVs hear each other. rounds and lost: as in `consensus.fuse`.
    Returns the bytes (n,) that each UAV sends.
    """
    given = {scan.uav: scan for scan in scans}
    times = sorted({scan.time for scan in scans} | ({time} if time is not None else set()))
    if len(times) != 1 or len(given) != len(scans):
        raise ValueError(
            f"scans must be of one time and of different UAVs, are at {times} s of {[s.uav for s in scans]}"
        )
    unknown = set(given) - {tracker.uav for tracker in fleet}
    if unknown:
        raise ValueError(f"scans of UAVs {sorted(unknown)}, of which the fleet has no tracker")
    for tracker in fleet:
        if tracker.uav in given:
            tracker.step(given[tracker.uav])
        else:
            tracker.coast(times[0])
    complete = ~np.eye(len(fleet), dtype=np.bool_)
    return fuse(fleet, complete if adjacency is None else adjacency, rounds, lost)
