"""Progress of a mission, as it is told while it flies."""

from typing import NamedTuple


class Moment(NamedTuple):
    """What is told of a mission at each scan."""

    time: float  # s
    scans: int  # so far
    distances: list[float]  # OSPA [m] of each UAV that works
    error: float  # their mean; NaN if none works
