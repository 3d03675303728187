"""Which tracks of different UAVs are the same person: ids agreed without a server."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from tracking.compiled import Array
from tracking.evidence import Evidence, Indices
from tracking.existence import from_log_odds
from tracking.kalman import moment_form

BIRTHS = 1_000  # ids one UAV can give in one scan
UAVS = 1_000
FIRST_BORN = BIRTHS * UAVS  # ids of tracks known from the start are below

INFORMATION = 4 + 16  # numbers of a packed (q, Ω)
_SAID_TWICE = 16 - 10  # numbers of a symmetric matrix that its upper triangle makes superfluous


@dataclass(frozen=True, eq=False)
class Message:
    """What a UAV tells its neighbours in one round of consensus, about T tracks by ascending id.

    The shares hold, in this order, a weight w, w q and w Ω: sums of them over UAVs, divided by the sum of the weights,
    are the Kullback-Leibler average of the UAVs' beliefs. Nothing in it is about third UAVs.
    One more column, where tracks may be nobody's, is w times the log-odds that there is somebody: the same average of
    beliefs in existence.
    """

    uav: int
    degree: int  # number of neighbours
    ids: Indices  # (T,)
    shares: Array  # (T, 1 + INFORMATION or more)
    evidence: Evidence
    deleted: tuple[tuple[int, float], ...] = ()  # ids and when [s] the fleet gave them up, ascending

    @property
    def size(self) -> int:
        """Bytes it takes on the air, each number eight, symmetric matrices by their upper triangles."""
        numbers_per_track = 1 + (self.shares.shape[1] - _SAID_TWICE) + (3 + 2)  # id, shares, evidence
        return 8 * int(2 + numbers_per_track * len(self.ids) + 2 * len(self.deleted))

    def beliefs(self) -> tuple[Array, Array]:
        """Means (T, 4) and covariances (T, 4, 4) of the tracks."""
        information = self.shares[:, 1 : 1 + INFORMATION] / self.shares[:, :1]
        return moment_form(information[:, :4], information[:, 4:].reshape(-1, 4, 4))

    def existence(self) -> Array:
        """Probabilities (T,) that there is somebody; 1 where nothing is said of it."""
        if self.shares.shape[1] == 1 + INFORMATION:
            return np.ones(len(self.ids))
        return from_log_odds(self.shares[:, 1 + INFORMATION] / self.shares[:, 0])

    def at(self, slots: Indices, ids: Indices) -> Message:
        """The same with its tracks moved to rows `slots` of a table with these ids; zero shares elsewhere."""
        shares = np.zeros((len(ids), self.shares.shape[1]))
        np.add.at(shares, slots, self.shares)
        times = np.full((len(ids), 3), -np.inf)
        np.maximum.at(times, slots, self.evidence.times)
        misses, shared = np.zeros(len(ids), np.int64), np.zeros(len(ids), np.int64)
        misses[slots], shared[slots] = self.evidence.misses, self.evidence.shared
        return replace(self, ids=ids, shares=shares, evidence=Evidence(times, misses, shared))


def born_id(scan: int, uav: int, counter: int) -> int:
    """An id no other birth in the fleet can have; older tracks have smaller ids."""
    return (scan * UAVS + uav) * BIRTHS + counter


def aligned(own: Message, received: Sequence[Message], gate: float) -> list[Message]:
    """The messages, own first, with the same tracks in the same rows.

    A neighbour's track with an id that is not here is matched to one of ours that the neighbour does not have, by
    statistical distance (squared, up to `gate`) and one assignment per neighbour; the smaller id stays. What finds no
    match is taken over with the neighbour's evidence and, so that nothing counts twice, without any share of ours.
    """
    if all(np.array_equal(m.ids, own.ids) and m.deleted == own.deleted for m in received):
        return [own, *received]
    deleted = _latest([own, *received])
    messages = [_surviving(m, deleted) for m in (own, *received)]
    roster = _Roster(messages[0])
    slots = [roster.admit(m, gate) for m in messages[1:]]
    slots.insert(0, np.arange(len(messages[0].ids)))
    ids = roster.ids()
    order = np.argsort(ids)
    row = np.argsort(order)
    out = [m.at(row[s], ids[order]) for m, s in zip(messages, slots, strict=True)]
    origin = roster.evidence[order]
    taken = replace(out[0].evidence, misses=origin.misses, shared=origin.shared)
    out[0] = replace(out[0], evidence=taken)
    return out


def _latest(messages: Sequence[Message]) -> tuple[tuple[int, float], ...]:
    latest: dict[int, float] = {}
    for m in messages:
        for id, time in m.deleted:
            latest[id] = max(time, latest.get(id, time))
    return tuple(sorted(latest.items()))


def _surviving(message: Message, deleted: tuple[tuple[int, float], ...]) -> Message:
    """Without tracks that somebody gave up after they were last seen."""
    given_up = dict(deleted)
    last_seen = message.evidence.times[:, 0].tolist()
    pairs = zip(message.ids.tolist(), last_seen, strict=True)
    keep = np.array([seen >= given_up.get(id, -np.inf) for id, seen in pairs], dtype=np.bool_)
    return replace(
        message,
        ids=message.ids[keep],
        shares=message.shares[keep],
        evidence=message.evidence[keep],
        deleted=deleted,
    )


class _Roster:
    """Rows of a table of tracks that fills up as neighbours are admitted."""

    def __init__(self, own: Message) -> None:
        self.slot = {id: k for k, id in enumerate(own.ids.tolist())}  # of every id heard this round
        self.means, self.covariances = own.beliefs()
        self.evidence = own.evidence

    def admit(self, message: Message, gate: float) -> Indices:
        """Rows of a neighbour's tracks (T,)."""
        slots = np.array([self.slot.get(id, -1) for id in message.ids.tolist()], dtype=np.int64)
        means, covariances = message.beliefs()
        free = np.setdiff1d(np.arange(len(self.means)), slots)
        new = np.flatnonzero(slots < 0)
        pairs = matches((self.means[free], self.covariances[free]), (means[new], covariances[new]), gate)
        for a, b in pairs:
            slots[new[b]] = free[a]
        new = np.flatnonzero(slots < 0)
        slots[new] = len(self.means) + np.arange(len(new))
        self.means = np.concatenate([self.means, means[new]])
        self.covariances = np.concatenate([self.covariances, covariances[new]])
        self.evidence = self.evidence + message.evidence[new]
        for id, slot in zip(message.ids.tolist(), slots.tolist(), strict=True):
            self.slot[id] = slot
        return slots

    def ids(self) -> Indices:
        """The smallest id heard for each row."""
        ids = np.full(len(self.means), np.iinfo(np.int64).max)
        for id, slot in self.slot.items():
            ids[slot] = min(ids[slot], id)
        return ids


def matches(ours: tuple[Array, Array], theirs: tuple[Array, Array], gate: float) -> list[tuple[int, int]]:
    """Pairs of beliefs (A, 4), (A, 4, 4) and (B, 4), (B, 4, 4) that agree best, in squared distance up to `gate`."""
    if len(ours[0]) == 0 or len(theirs[0]) == 0:
        return []
    difference = ours[0][:, None] - theirs[0][None]
    spread = ours[1][:, None] + theirs[1][None]
    distance = (difference * np.linalg.solve(spread, difference[..., None])[..., 0]).sum(axis=2)
    # A pair beyond the gate costs as much as no pair, so the assignment prefers many pairs within it.
    rows, columns = linear_sum_assignment(np.minimum(distance, gate))
    return [(int(a), int(b)) for a, b in zip(rows, columns, strict=True) if distance[a, b] <= gate]
