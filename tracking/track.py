"""Scans, which trackers take, and tracks, which they hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import NO_TREES, Forest
from tracking.numerics.arrays import Array, Flags, Indices

# Existence probability up to which a track is not reported. With existence probability r, squared error e and cut-off
# c, a reported track costs GOSPA r e + (1 - r) c² / 2, and one that is left out r c² / 2.
UNLIKELY = 0.5
# Columns of `times`: the fleet's last detection, the last scan that had the person in view, the last sure detection,
# and the last earlier frame that showed a part of the belief.
DETECTED_AT, EXPECTED_AT, SURE_AT, FRAME_AT = range(4)
# Columns of `views`: the scan's frame, with no samples if association has used it, and the frame before.
THIS_FRAME, FRAME_BEFORE = range(2)
SIGHTED_AT = 2  # column of `sightings`: time


@dataclass(frozen=True, eq=False)
class Scan:
    """Measurements of one UAV at one instant.

    Attributes:
        uav: number of the UAV.
        time: time [s] since the start.
        pose: pose of the camera, as its UAV believes it.
        measurements: (N, 2) m: east and north, on the ground.
        covariances: (N, 2, 2) m², of the errors of `measurements`.
        forest: the trees, as its UAV believes at this time.
    """

    uav: int
    time: float
    pose: Pose
    measurements: Array
    covariances: Array
    forest: Forest = NO_TREES


@dataclass(frozen=True, eq=False)
class Track:
    """Track of a person; its id is the same on all UAVs that agree on the track.

    Attributes:
        id: number of the track.
        belief: position and velocity of the person, (4,) m and m/s, with their covariance.
        existence: probability that there is such a person; 1 if the tracker estimates none, as with m of n scans.
        sighting: (3,) position [m] and time [s] of the fleet's last sure detection; NaN if the tracker gives none.
    """

    id: int
    belief: Gaussian
    existence: float = 1.0
    sighting: Array = field(default_factory=lambda: np.full(3, np.nan))

    def renumber(self, id: int) -> Track:
        """The same track by another id, in half the constructor's time."""
        track = object.__new__(Track)
        track.__dict__.update(self.__dict__, id=id)
        return track

    @property
    def reported(self) -> bool:
        """True if the person more likely exists than not.

        Less likely tracks are still hypotheses: planners weight them, and a measurement may confirm them.
        Source: [GarciaFernandez18], its first estimator, with the threshold of GOSPA for small errors.
        """
        return self.existence > UNLIKELY


def make_tracks(
    ids: Indices, means: Array, covariances: Array, existence: Array, sightings: Array
) -> tuple[Track, ...]:
    """Tracks with copies of these arrays. A sighting becomes NaN if its time is below 0 or NaN.

    ids (T,); means (T, 4); covariances (T, 4, 4); existence (T,): probabilities; sightings (T, 3): positions and times
    of the last sure detections.
    """
    known = np.where(sightings[:, 2:] >= 0.0, sightings, np.nan)
    tracks = []
    for id, mean, covariance, r, sighting in zip(
        ids.tolist(), means.copy(), covariances.copy(), existence.tolist(), known, strict=True
    ):
        belief, track = object.__new__(Gaussian), object.__new__(Track)  # in two thirds of the constructors' time
        values = belief.__dict__
        values["mean"], values["covariance"] = mean, covariance
        values = track.__dict__
        values["id"], values["belief"], values["existence"], values["sighting"] = id, belief, r, sighting
        tracks.append(track)
    return tuple(tracks)


class Beliefs(NamedTuple):
    """Gaussian beliefs in the states of T people."""

    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)


def beliefs_of(tracks: Sequence[Track]) -> Beliefs:
    """Beliefs of tracks."""
    means = np.array([t.belief.mean for t in tracks], dtype=float).reshape(-1, 4)
    return Beliefs(means, np.array([t.belief.covariance for t in tracks], dtype=float).reshape(-1, 4, 4))


@dataclass(eq=False)  # a frozen one takes four times as long to make
class TrackTable:
    """Columns of T confirmed tracks of one UAV; `table[rows]` has some of them."""

    ids: Indices  # (T,)
    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    existence: Array  # (T,) probabilities
    weights: Array  # (T,) of beliefs in the fleet's average
    times: Array  # (T, 4) s, with the columns `DETECTED_AT`, `EXPECTED_AT`, `SURE_AT` and `FRAME_AT`
    views: Indices  # (T, 2) bits: samples of the belief in view, with the columns `THIS_FRAME` and `FRAME_BEFORE`
    misses: Indices  # (T,), bit k is set if the k-th last scan that counts was a miss
    sightings: Array  # (T, 3) position [m] and time [s] of the fleet's last sure detection of each

    def __getitem__(self, rows: Indices | Flags | slice) -> TrackTable:
        return TrackTable(*[column[rows] for column in _COLUMNS(self)])


def join_tables(tables: Sequence[TrackTable]) -> TrackTable:
    """Table of all tracks of tables, in copies."""
    return TrackTable(*map(np.concatenate, zip(*map(_COLUMNS, tables), strict=True)))


def make_table(tracks: Sequence[Track], weights: float | Array, times: float | Array) -> TrackTable:
    """Table of tracks without a sighting yet; weights (T,) and times (T, 4), or one number for all."""
    count, (means, covariances) = len(tracks), beliefs_of(tracks)
    return TrackTable(
        ids=np.array([t.id for t in tracks], dtype=np.int64),
        means=means,
        covariances=covariances,
        existence=np.array([t.existence for t in tracks], dtype=float),
        weights=np.full(count, weights),
        times=np.full((count, 4), times),
        views=np.zeros((count, 2), dtype=np.int64),
        misses=np.zeros(count, dtype=np.int64),
        sightings=np.column_stack([means[:, :2], np.full(count, -np.inf)]),
    )


_COLUMNS = attrgetter(*TrackTable.__dataclass_fields__)
