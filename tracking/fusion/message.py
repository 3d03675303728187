"""Messages by which UAVs exchange their tracks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tracking.association.jipda import from_log_odds
from tracking.filter.information import moment_form
from tracking.management.deletion import DetectionHistory
from tracking.numerics.arrays import Array, Indices

INFORMATION = 4 + 16  # numbers of a packed (q, Ω)
_REDUNDANT = 16 - 10  # numbers of a symmetric matrix below its upper triangle


@dataclass(frozen=True, eq=False)
class Message:
    """Message of a UAV to its neighbours in one round of consensus, about T tracks by ascending id.

    The shares hold, in this order, a weight w, w q and w Ω: sums of them over UAVs, divided by the sum of the weights,
    are a weighted average of the UAVs' beliefs. With existence probabilities one more column holds w times their
    log-odds, and is averaged likewise.
    Novel information adds up: q and Ω, then in column `INFORMATION` + u the share of UAV u's in it. With fusion by
    averages alone it has no columns.
    An alias is the id that a track takes if tracks of one id turn out to be two people. Alias 0 marks a lost track: if
    another track of its id was seen lately, that one has the person. UAVs of one partition of the fleet give the same
    track the same alias.
    """

    uav: int
    degree: int  # number of neighbours
    ids: Indices  # (T,)
    shares: Array  # (T, 1 + INFORMATION or more)
    history: DetectionHistory
    deleted: tuple[tuple[int, float], ...]  # ids, ascending, and the time [s] up to which sightings of them are void
    aliases: Indices  # (T,)
    sightings: Array  # (T, 3), position [m] and time [s] at which the fleet last saw each
    novel: Array  # (T, 0) or (T, INFORMATION + U)
    partition: tuple[int, float]  # its leader, the smallest UAV heard of lately, and the time [s] of its last message
    met: bool = False  # if UAVs of different partitions have heard one another in this scan

    @property
    def size(self) -> int:
        """Bytes of the message, eight for each number, with symmetric matrices as upper triangles.

        Four numbers, 25 per track and 2 per deleted track; 14 more for novel information, and 2 for each UAV with a
        share in it.
        """
        per_track = 2 + (self.shares.shape[1] - _REDUNDANT) + (3 + 2) + 3  # ids, shares, history, sighting
        sources = self.novel[:, INFORMATION:] != 0.0
        novel = 2 * sources.sum() + (INFORMATION - _REDUNDANT) * sources.any(axis=1).sum()
        return 8 * int(4 + per_track * len(self.ids) + novel + 2 * len(self.deleted))

    def beliefs(self) -> tuple[Array, Array]:
        """Means (T, 4) and covariances (T, 4, 4) of the tracks."""
        return self._beliefs

    @cached_property
    def _beliefs(self) -> tuple[Array, Array]:
        packed = self.shares[:, 1 : 1 + INFORMATION] / self.shares[:, :1]
        if self.novel.shape[1] > INFORMATION:
            # Mixing has left a share of every UAV's information. Division by the largest share undoes the mixing where
            # it has converged, and counts no information more than once where it has not.
            most = self.novel[:, INFORMATION:].max(axis=1, keepdims=True)
            packed = packed + self.novel[:, :INFORMATION] / np.where(most > 0.0, most, 1.0)
        return moment_form(packed[:, :4], packed[:, 4:].reshape(-1, 4, 4))

    def existence(self) -> Array:
        """Existence probabilities (T,); 1 where the message has none."""
        if self.shares.shape[1] == 1 + INFORMATION:
            return np.ones(len(self.ids))
        return from_log_odds(self.shares[:, 1 + INFORMATION] / self.shares[:, 0])

    @cached_property
    def labels(self) -> bytes:
        """Ids and aliases, quick to compare."""
        return self.ids.tobytes() + self.aliases.tobytes()

    @cached_property
    def counts(self) -> bytes:
        """Counts of the detection history, quick to compare."""
        return self.history.misses.tobytes() + self.history.shared.tobytes()

    @cached_property
    def sighting_times(self) -> bytes:
        """Times of the sightings, quick to compare."""
        return self.sightings[:, 2].tobytes()

    def only(self, rows: Indices) -> Message:
        """The message about some of the tracks."""
        return replace(
            self,
            ids=self.ids[rows],
            shares=self.shares[rows],
            history=self.history[rows],
            aliases=self.aliases[rows],
            sightings=self.sightings[rows],
            novel=self.novel[rows],
        )

    def at(self, slots: Indices, ids: Indices, aliases: Indices) -> Message:
        """The message with its tracks moved to rows `slots` of a table with these ids; zero shares elsewhere."""
        times, seen = np.full((len(ids), 3), -np.inf), np.full((len(ids), 3), -np.inf)
        np.maximum.at(times, slots, self.history.times)
        by_time = np.argsort(self.sightings[:, 2], kind="stable")  # where two tracks become one, the last sighting
        seen[slots[by_time]] = self.sightings[by_time]
        misses, shared = np.zeros(len(ids), np.int64), np.zeros(len(ids), np.int64)
        misses[slots], shared[slots] = self.history.misses, self.history.shared
        return replace(
            self,
            ids=ids,
            shares=_placed(self.shares, slots, len(ids)),
            history=DetectionHistory(times, misses, shared),
            aliases=aliases,
            sightings=seen,
            novel=_placed(self.novel, slots, len(ids)),
        )


def _placed(values: Array, slots: Indices, count: int) -> Array:
    """Rows added up in a table of `count` rows."""
    table = np.zeros((count, values.shape[1]))
    np.add.at(table, slots, values)
    return table


def alike(messages: Sequence[Message]) -> bool:
    """Test if messages are about the same tracks in the same rows.

    Where partitions meet, tracks of one id without alias need not be the same.
    """
    first = messages[0]
    if any(m.labels != first.labels or m.deleted != first.deleted for m in messages):
        return False
    return not ((first.aliases == 0).any() and partitions_meet(messages))


def partitions_meet(messages: Sequence[Message]) -> bool:
    """Test if UAVs of different partitions hear one another, by the messages of one round, the own included."""
    return any(m.met or m.partition[0] != messages[0].partition[0] for m in messages)
