"""Messages: what UAVs send each other about their tracks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tracking.association.jpda import from_log_odds
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.factorisation import inverses
from tracking.numerics.matrices import products
from tracking.track import SIGHTED_AT, SURE_AT, Beliefs

INFORMATION = 4 + 16  # numbers of a packed (q, Ω)
# Columns of `Message.shares`: the weight, and the log-odds of existence; between them are the numbers of (q, Ω).
WEIGHT, LOG_ODDS = 0, 1 + INFORMATION
_REDUNDANT = 16 - 10  # numbers of a symmetric matrix below its upper triangle
# Columns of tracks, and their values for a track that a message lacks; -1 has all bits.
EMPTY = {
    "ids": -1,
    "keys": -1,
    "shares": 0,
    "times": -np.inf,
    "views": 0,
    "misses": -1,
    "sightings": -np.inf,
    "novel": 0,
}
_PER_TRACK = 3 + (1 + INFORMATION - _REDUNDANT + 1) + 4 + 2 + 1 + 3  # id and key, shares, and the rest
# Ids of new tracks are unique in a fleet, without a server.
IDS_PER_SCAN = 1_000  # per UAV: the first half for new tracks, the second for tracks that lose their id to another
UAVS = 1_000
FIRST_NEW_ID = IDS_PER_SCAN * UAVS  # ids of initial tracks are smaller


class Partition(NamedTuple):
    """Part of a fleet whose UAVs hear of the same leader, and so agree on ids."""

    leader: int  # the smallest UAV heard of lately
    time: float  # s, of the leader's last message


class EndedTrack(NamedTuple):
    """A track that the fleet has deleted."""

    id: int
    until: float  # s, up to which sightings of the track are void


@dataclass(eq=False)  # a frozen one takes four times as long to make
class Message:
    """Message of a UAV to its neighbours in one round of consensus, about T tracks by ascending id.

    The shares are, in this order, a weight w, w q, w Ω, and w times the log-odds of existence. Their sums over UAVs,
    divided by the sum of the weights, are weighted averages. Novel information consists of q and Ω, which add up, and
    in column `INFORMATION` + u the share of UAV u in them. With fusion by averages alone it has no columns.
    Ids may change from round to round. The key of a track, its leader and its id before the first round, stays the same
    in all rounds of a scan.

    Attributes:
        uav: number of the UAV.
        degree: number of neighbours.
        scan: number of scans so far, this one included.
        time: time of this scan [s].
        partition: ids of the UAVs that the sender hears, directly or not.
        ids: (T,) ids of tracks.
        keys: (T, 2) keys of tracks.
        shares: (T, 22) shares.
        times: (T, 4) s: as in `tracking.track.TrackTable`.
        views: (T, 2), as in `TrackTable`, of all UAVs heard.
        misses: (T,), bit k is set if the k-th last scan that counts was a miss.
        sightings: (T, 3), position [m] and time [s] of the fleet's last sure detection before this scan.
        deleted: tracks that ended, by ascending id.
        novel: (T, 0) or (T, INFORMATION + U), U > 0.
    """

    uav: int
    degree: int
    scan: int
    time: float
    partition: Partition
    ids: Indices
    keys: Indices
    shares: Array
    times: Array
    views: Indices
    misses: Indices
    sightings: Array
    deleted: tuple[EndedTrack, ...]
    novel: Array

    @property
    def size(self) -> int:
        """Bytes of the message, eight for each number, with symmetric matrices as upper triangles."""
        return 8 * (self.numbers + int(count_novel_numbers(self.novel)))

    @property
    def numbers(self) -> int:
        """Count of the numbers without novel information: 6, 29 for each track, and 2 for each deleted id."""
        return count_plain_numbers(len(self.ids), len(self.deleted))

    @cached_property
    def beliefs(self) -> Beliefs:
        """Beliefs of the tracks."""
        return Beliefs(*find_beliefs(np.ascontiguousarray(self.shares), np.ascontiguousarray(self.novel)))

    @cached_property
    def table(self) -> tuple[object, ...]:
        """What messages have in common if their tracks need no association, as numbers and bytes."""
        sighted = self.sightings[:, SIGHTED_AT]
        return self.partition.leader, self.deleted, self.ids.tobytes(), self.keys.tobytes(), sighted.tobytes()

    def existence(self) -> Array:
        """Existence probabilities (T,)."""
        return read_existence(self.shares)

    def latest_sightings(self) -> Array:
        """Position [m] and time [s] of the last sure detections (T, 3), including this scan."""
        return find_latest_sightings(self.sightings, self.times, self.beliefs.means, self.time)


@compiled
def find_beliefs(shares: Array, novel: Array) -> tuple[Array, Array]:
    """Means (T, 4) and covariances (T, 4, 4) from columns of messages."""
    packed = shares[:, 1:LOG_ODDS] / shares[:, :1]
    for t in range(len(packed) if novel.shape[1] > INFORMATION else 0):
        # Mixing has left a share of each UAV's information. Division by the largest share undoes the mixing if it has
        # converged, and counts no information more than once if it has not.
        most = novel[t, INFORMATION:].max()
        for i in range(INFORMATION):  # a loop, because Numba compiles 3 s for the error of arrays of other shapes
            packed[t, i] += novel[t, i] / (most if most > 0.0 else 1.0)
    covariances = inverses(packed[:, 4:].copy().reshape(-1, 4, 4))
    return products(covariances, packed[:, :4].copy().reshape(-1, 4, 1))[:, :, 0].copy(), covariances


@compiled
def read_existence(shares: Array) -> Array:
    """Existence probabilities (T,) from shares (T, 22)."""
    out = np.empty(len(shares))
    for t in range(len(out)):
        out[t] = from_log_odds(shares[t, LOG_ODDS] / shares[t, WEIGHT])
    return out


@compiled
def find_latest_sightings(sightings: Array, times: Array, means: Array, now: float) -> Array:
    """Last sure detections (T, 3), up to the scan at `now` s, from columns of messages and means (T, 4)."""
    latest = sightings.copy()
    for t in range(len(latest)):
        if times[t, SURE_AT] >= now:
            latest[t, 0], latest[t, 1], latest[t, 2] = means[t, 0], means[t, 1], now
    return latest


def are_alike(messages: Sequence[Message]) -> bool:
    """True if messages have the same tracks in the same rows, with the same times of sightings before this scan."""
    same = [m.table for m in messages]
    return not same or same.count(same[0]) == len(same)


def count_plain_numbers(tracks: int, deleted: int) -> int:
    """Count the numbers of a message about so many tracks and deletions, without novel information."""
    return 6 + _PER_TRACK * tracks + 2 * deleted


@compiled
def count_novel_numbers(novel: Array) -> int:
    """Count the numbers of novel information (T, ...): 14 for each track with any, 2 more for each UAV with a share."""
    total = 0
    for t in range(len(novel)):
        shares = int(np.count_nonzero(novel[t, INFORMATION:]))
        total += 2 * shares + (INFORMATION - _REDUNDANT if shares else 0)
    return total


def new_id(scan: int, uav: int, counter: int) -> int:
    """Id that no other new track of the fleet can have; older tracks have smaller ids."""
    return (scan * UAVS + uav) * IDS_PER_SCAN + counter


def is_new_id(ids: Indices, scan: int) -> Flags:
    """Flags (T,) of ids of tracks that began in a scan, rather than tracks that got another id in it."""
    return (ids >= new_id(scan, 0, 0)) & (ids % IDS_PER_SCAN < IDS_PER_SCAN // 2)
