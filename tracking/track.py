"""Scans and tracks: what a tracker is given, and what it holds."""

from dataclasses import dataclass

from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.numerics.arrays import Array


@dataclass(frozen=True, eq=False)
class Scan:
    """Measurements of one UAV at one instant."""

    uav: int
    time: float  # s
    pose: Pose  # of the camera
    measurements: Array  # (N, 2) m, on the ground
    covariances: Array  # (N, 2, 2) m²


@dataclass(frozen=True, eq=False)
class Track:
    """Track of a person; its id is the same on all UAVs that agree on the track."""

    id: int
    belief: Gaussian
    existence: float = 1.0  # probability; 1 where the tracker has none, as where life is m_of_n
