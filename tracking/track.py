"""Scans and tracks: what a tracker is given, and what it holds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.numerics.arrays import Array, Indices


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
    seen: float = -math.inf  # s, last detection of this UAV's fleet that it knows of; -inf: none, or not known


def tracks_of(
    ids: Indices, means: Array, covariances: Array, existence: Array, seen: Array | None = None
) -> tuple[Track, ...]:
    """Tracks with ids (T,), means (T, 4), covariances (T, 4, 4), existence and, if known, `seen` (T,), all copied."""
    known = np.full(len(ids), -math.inf) if seen is None else seen
    rows = zip(ids.tolist(), means, covariances, existence.tolist(), known.tolist(), strict=True)
    return tuple(Track(id, Gaussian(mean.copy(), covariance.copy()), r, last) for id, mean, covariance, r, last in rows)


def beliefs_of(tracks: Sequence[Track]) -> tuple[Array, Array]:
    """Means (T, 4) and covariances (T, 4, 4) of tracks."""
    means = np.array([t.belief.mean for t in tracks], dtype=float).reshape(-1, 4)
    return means, np.array([t.belief.covariance for t in tracks], dtype=float).reshape(-1, 4, 4)
