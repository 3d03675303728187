"""What UAVs say about their tracks, and ids that no two people get."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tracking.association.jipda import from_log_odds
from tracking.filter.kalman import moment_form
from tracking.management.deletion import Evidence, Indices
from tracking.numerics.compiled import Array

BIRTHS = 1_000  # ids one UAV can give in one scan: to births the first half, as aliases the second
UAVS = 1_000
FIRST_BORN = BIRTHS * UAVS  # ids of tracks known from the start are below

INFORMATION = 4 + 16  # numbers of a packed (q, Ω)
_SAID_TWICE = 16 - 10  # numbers of a symmetric matrix that its upper triangle makes superfluous


@dataclass(frozen=True, eq=False)
class Message:
    """What a UAV tells its neighbours in one round of consensus, about T tracks by ascending id.

    The shares hold, in this order, a weight w, w q and w Ω: sums of them over UAVs, divided by the sum of the weights,
    are a weighted average of the UAVs' beliefs. One more column, where tracks may be nobody's, is w
    times the log-odds that there is somebody, and averaged likewise.
    The novel part is information that adds up: q and Ω, then in column `INFORMATION` + u the share that UAV u's has
    in it. With fusion by averages alone it has no columns.
    An alias is the id a track takes if tracks of one id turn out to be two people; 0: it was not seen of late, so if
    another of its id was, that is where the person is. UAVs of one company give the same track the same alias.
    """

    uav: int
    degree: int  # number of neighbours
    ids: Indices  # (T,)
    shares: Array  # (T, 1 + INFORMATION or more)
    evidence: Evidence
    deleted: tuple[tuple[int, float], ...]  # ids, ascending, and until when [s] sightings of them are void
    aliases: Indices  # (T,)
    sightings: Array  # (T, 3), where [m] and when [s] the fleet last saw each
    novel: Array  # (T, 0) or (T, INFORMATION + U)
    company: tuple[int, float]  # the smallest UAV heard of lately, and when [s] it spoke
    met: bool = False  # whether it has heard in this scan that UAVs of different companies hear one another

    @property
    def size(self) -> int:
        """Bytes it takes on the air, each number eight, symmetric matrices by their upper triangles.

        Per track 25 numbers; 14 more for novel information, and 2 for each UAV that has a share in it.
        """
        per_track = 2 + (self.shares.shape[1] - _SAID_TWICE) + (3 + 2) + 3  # ids, shares, evidence, sighting
        sources = self.novel[:, INFORMATION:] != 0.0
        novel = 2 * sources.sum() + (INFORMATION - _SAID_TWICE) * sources.any(axis=1).sum()
        return 8 * int(4 + per_track * len(self.ids) + novel + 2 * len(self.deleted))

    def beliefs(self) -> tuple[Array, Array]:
        """Means (T, 4) and covariances (T, 4, 4) of the tracks."""
        return self._beliefs

    @cached_property
    def _beliefs(self) -> tuple[Array, Array]:
        packed = self.shares[:, 1 : 1 + INFORMATION] / self.shares[:, :1]
        if self.novel.shape[1] > INFORMATION:
            # Mixing has left a share of every UAV's information. What makes the largest share whole makes up for the
            # mixing where it has converged, and counts nobody's information more than once where it has not.
            most = self.novel[:, INFORMATION:].max(axis=1, keepdims=True)
            packed = packed + self.novel[:, :INFORMATION] / np.where(most > 0.0, most, 1.0)
        return moment_form(packed[:, :4], packed[:, 4:].reshape(-1, 4, 4))

    def existence(self) -> Array:
        """Probabilities (T,) that there is somebody; 1 where nothing is said of it."""
        if self.shares.shape[1] == 1 + INFORMATION:
            return np.ones(len(self.ids))
        return from_log_odds(self.shares[:, 1 + INFORMATION] / self.shares[:, 0])

    @cached_property
    def called(self) -> bytes:
        """Ids and aliases, quick to compare."""
        return self.ids.tobytes() + self.aliases.tobytes()

    @cached_property
    def counts(self) -> bytes:
        """What counts against the tracks, quick to compare."""
        return self.evidence.misses.tobytes() + self.evidence.shared.tobytes()

    @cached_property
    def seen_at(self) -> bytes:
        """Times of the sightings, quick to compare."""
        return self.sightings[:, 2].tobytes()

    def only(self, rows: Indices) -> Message:
        """The same about some of the tracks."""
        return replace(
            self,
            ids=self.ids[rows],
            shares=self.shares[rows],
            evidence=self.evidence[rows],
            aliases=self.aliases[rows],
            sightings=self.sightings[rows],
            novel=self.novel[rows],
        )

    def at(self, slots: Indices, ids: Indices, aliases: Indices) -> Message:
        """The same with its tracks moved to rows `slots` of a table with these ids; zero shares elsewhere."""
        times, seen = np.full((len(ids), 3), -np.inf), np.full((len(ids), 3), -np.inf)
        np.maximum.at(times, slots, self.evidence.times)
        by_time = np.argsort(self.sightings[:, 2], kind="stable")  # where two tracks become one, the last sighting
        seen[slots[by_time]] = self.sightings[by_time]
        misses, shared = np.zeros(len(ids), np.int64), np.zeros(len(ids), np.int64)
        misses[slots], shared[slots] = self.evidence.misses, self.evidence.shared
        return replace(
            self,
            ids=ids,
            shares=_placed(self.shares, slots, len(ids)),
            evidence=Evidence(times, misses, shared),
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
    """Whether messages are about the same tracks in the same rows.

    Where companies meet, those of a name without alias need not be the same.
    """
    first = messages[0]
    if any(m.called != first.called or m.deleted != first.deleted for m in messages):
        return False
    return not ((first.aliases == 0).any() and companies_meet(messages))


def companies_meet(messages: Sequence[Message]) -> bool:
    """Whether UAVs of different companies hear one another, by the messages of one round, one's own included."""
    return any(m.met or m.company[0] != messages[0].company[0] for m in messages)


def born_id(scan: int, uav: int, counter: int) -> int:
    """An id no other birth in the fleet can have; older tracks have smaller ids."""
    return (scan * UAVS + uav) * BIRTHS + counter


def is_birth(ids: Indices, scan: int) -> NDArray[np.bool_]:
    """Which ids (T,) were given to tracks born in a scan, rather than as aliases in it."""
    return np.asarray((ids >= born_id(scan, 0, 0)) & (ids % BIRTHS < BIRTHS // 2))


def aliases_of(ids: Indices, lost: Indices, scan: int, leader: int) -> Indices:
    """An alias for each track of a company whose leader is UAV `leader` (T,), from ids (T,) and lost ones' rows.

    Those born in this scan have nobody else's id: their aliases are their own. The others take ids that no birth has,
    counted from the end of the leader's.
    """
    rank = np.arange(len(ids))
    aliases = np.where(is_birth(ids, scan), ids, born_id(scan, leader, BIRTHS - 1) - rank)
    aliases[lost] = 0
    return aliases
