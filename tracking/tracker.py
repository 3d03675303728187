"""One UAV's tracker."""

from __future__ import annotations

from dataclasses import dataclass

from tracking.camera import Pose
from tracking.compiled import Array
from tracking.kalman import Gaussian


@dataclass(frozen=True, eq=False)
class Scan:
    """What one UAV measured at one instant."""

    uav: int
    time: float  # s
    pose: Pose  # of the camera
    measurements: Array  # (N, 2) m, on the ground
    covariances: Array  # (N, 2, 2) m²


@dataclass(frozen=True, eq=False)
class Track:
    """A person held by a tracker; the id is the same on all UAVs that agree on the track."""

    id: int
    belief: Gaussian
