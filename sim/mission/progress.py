"""Progress of a mission in flight."""

from typing import NamedTuple


class ScanProgress(NamedTuple):
    """Progress at one scan."""

    time: float  # s
    scans: int  # so far
    distances: list[float]  # OSPA [m] of each UAV that works
    error: float  # their mean; NaN if none works
