"""Account of what a tracker did in one scan: association, births, deletions and re-acquisitions of tracks."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from tracking.measurement_update import ScanPrediction, ScanUpdate
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.distances import squared_distance


@dataclass(frozen=True, eq=False)
class Association:
    """Data association of T tracks, predicted to a scan, with its N measurements."""

    ids: Indices  # (T,)
    before: ScanPrediction
    measurements: Array  # (N, 2) m
    covariances: Array  # (N, 2, 2) m²
    after: ScanUpdate

    def gated(self) -> Flags:
        """Flags (T, N) of the measurements in each track's gate."""
        inside = np.zeros((len(self.ids), len(self.measurements)), dtype=np.bool_)
        inside[tuple(self.after.gates.T)] = True
        return inside

    def weights(self) -> Array:
        """Probability (T, N) that each measurement is the person's; `after.missed` is the probability that none is."""
        found = np.zeros((len(self.ids), len(self.measurements)))
        found[tuple(self.after.gates.T)] = self.after.weights
        return found

    def distances(self) -> Array:
        """Squared Mahalanobis distances (T, N) of the measurements, by the innovation covariance."""
        innovations = self.measurements - self.before.means[:, None, :2]
        return squared_distance(innovations, self.before.covariances[:, None, :2, :2] + self.covariances)


class Origin(NamedTuple):
    """A measurement from which a track was initiated."""

    time: float  # s
    place: Array  # (2,) m


class Birth(NamedTuple):
    """Confirmation of a new track."""

    id: int
    origins: tuple[Origin, ...]  # the measurements that were more likely the track's than not, in order of time


# "unlikely": by its existence or, with m of n, by its misses; "merged": it shared its person with another track
DeletionReason = Literal["unlikely", "variance", "merged"]


class Deletion(NamedTuple):
    """Deletion of a track."""

    id: int
    reason: DeletionReason
    existence: float
    variance: float  # m², trace of the position's covariance
    merged_into: int | None  # id of the track that goes on, if merged


class Reacquisition(NamedTuple):
    """Continuation of a lost track by a new one."""

    id: int  # of the lost track, which goes on
    new_id: int  # that the new track had until then


@dataclass(eq=False)
class ScanAccount:
    """Account of one scan; it holds what the tracker computed anyway, so it costs nothing to keep."""

    find_association: Callable[[], Association] | None = None
    births: list[Birth] = field(default_factory=list)
    deletions: list[Deletion] = field(default_factory=list)
    reacquisitions: list[Reacquisition] = field(default_factory=list)

    @cached_property
    def association(self) -> Association | None:
        """Association with the scan; None if the tracker had no frame."""
        return self.find_association() if self.find_association else None
