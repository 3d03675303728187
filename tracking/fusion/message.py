"""Messages by which UAVs exchange their tracks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tracking.association.jipda import from_log_odds
from tracking.filter.information import moment_form
from tracking.numerics.arrays import Array, Indices

INFORMATION = 4 + 16  # numbers of a packed (q, Ω)
_REDUNDANT = 16 - 10  # numbers of a symmetric matrix below its upper triangle
_COLUMNS = ("ids", "names", "shares", "times", "misses", "sightings", "novel")
_PER_TRACK = 3 + (1 + INFORMATION - _REDUNDANT + 1) + 3 + 1 + 3  # id and name, shares, times, misses, sighting


@dataclass(frozen=True, eq=False)
class Message:
    """Message of a UAV to its neighbours in one round of consensus, about T tracks by ascending id.

    The shares hold, in this order, a weight w, w q, w Ω, and w times the log-odds of existence: sums of them over UAVs,
    divided by the sum of the weights, are weighted averages. Novel information adds up: q and Ω, then in column
    `INFORMATION` + u the share of UAV u's in it. With fusion by averages alone it has no columns.
    UAVs of one partition of the fleet, those that hear of the same leader, agree on ids: the leader and the id at the
    beginning of a scan name a track in all its rounds, while ids may change.
    """

    uav: int
    degree: int  # number of neighbours
    scan: int  # number of scans so far, this one included
    time: float  # s, of this scan
    partition: tuple[int, float]  # its leader, the smallest UAV heard of lately, and the time [s] of its last message
    ids: Indices  # (T,)
    names: Indices  # (T, 2)
    shares: Array  # (T, 22)
    times: Array  # (T, 3) s: last detection by the fleet, last scan with the person in view, and last sure detection
    misses: Indices  # (T,), bit k is set if the k-th last scan that counts was a miss
    sightings: Array  # (T, 3), position [m] and time [s] of the fleet's last sure detection before this scan
    deleted: tuple[tuple[int, float], ...]  # ids, ascending, and the time [s] up to which sightings of them are void
    novel: Array  # (T, 0) or (T, INFORMATION + U)

    @property
    def size(self) -> int:
        """Bytes of the message."""
        return message_size(self.novel, self.deleted)

    @cached_property
    def beliefs(self) -> tuple[Array, Array]:
        """Means (T, 4) and covariances (T, 4, 4) of the tracks."""
        packed = self.shares[:, 1 : 1 + INFORMATION] / self.shares[:, :1]
        if self.novel.shape[1] > INFORMATION:
            # Mixing has left a share of every UAV's information. Division by the largest share undoes the mixing where
            # it has converged, and counts no information more than once where it has not.
            most = self.novel[:, INFORMATION:].max(axis=1, keepdims=True)
            packed = packed + self.novel[:, :INFORMATION] / np.where(most > 0.0, most, 1.0)
        return moment_form(packed[:, :4], packed[:, 4:].reshape(-1, 4, 4))

    def existence(self) -> Array:
        """Existence probabilities (T,)."""
        return from_log_odds(self.shares[:, 1 + INFORMATION] / self.shares[:, 0])

    def only(self, rows: Indices) -> Message:
        """The message about some of the tracks."""
        columns: dict[str, Any] = {name: getattr(self, name)[rows] for name in _COLUMNS}
        return replace(self, **columns)

    def at(self, rows: Indices, ids: Indices, names: Indices) -> Message:
        """The message with its tracks moved to rows of a table of these ids and names; elsewhere it says nothing."""
        empty = {"times": -np.inf, "sightings": -np.inf, "misses": -1}  # -1 has all bits
        columns: dict[str, Any] = {}
        for name in _COLUMNS:
            column = getattr(self, name)
            columns[name] = np.full((len(ids), *column.shape[1:]), empty.get(name, 0), column.dtype)
            columns[name][rows] = column
        return replace(self, **{**columns, "ids": ids, "names": names})


def alike(messages: Sequence[Message]) -> bool:
    """Test if messages are about the same tracks in the same rows, last seen at the same times but for this scan."""
    first = messages[0]
    return all(
        m.partition[0] == first.partition[0]
        and m.deleted == first.deleted
        and np.array_equal(m.ids, first.ids)
        and np.array_equal(m.names, first.names)
        and np.array_equal(m.sightings[:, 2], first.sightings[:, 2])
        for m in messages
    )


def last_seen(message: Message) -> tuple[Array, Array]:
    """Times (T,) [s] and places (T, 2) [m] of the last sure detections, in this scan or before."""
    now = message.times[:, 2] >= message.time
    means, _ = message.beliefs
    return (
        np.where(now, message.time, message.sightings[:, 2]),
        np.where(now[:, None], means[:, :2], message.sightings[:, :2]),
    )


def joint_partition(partitions: Iterable[tuple[int, float]]) -> tuple[int, float]:
    """The smallest leader of partitions, and the time of its last message."""
    return min(partitions, key=lambda partition: (partition[0], -partition[1]))


def message_size(novel: Array, deleted: tuple[tuple[int, float], ...]) -> int:
    """Bytes of a message, eight for each number, with symmetric matrices as upper triangles.

    6 numbers, 26 for each track, 2 for each deleted id; 14 more for novel information, and 2 for each UAV with a
    share in it.
    """
    numbers = 6 + _PER_TRACK * len(novel) + 2 * len(deleted)
    if novel.shape[1] > INFORMATION:
        rows, _ = np.nonzero(novel[:, INFORMATION:])
        numbers += 2 * len(rows) + (INFORMATION - _REDUNDANT) * len(set(rows.tolist()))
    return 8 * numbers
