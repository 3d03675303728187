"""Consensus by messages between neighbours: averages of beliefs, and sums of what UAVs have learned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracking.fusion.message import Message, alike, companies_meet
from tracking.fusion.track_association import aligned
from tracking.management.deletion import Evidence, Indices
from tracking.numerics.compiled import Array, compiled


class Member(Protocol):
    """What takes part in consensus."""

    @property
    def match_gate(self) -> float:
        """Largest squared distance at which tracks of different ids are taken for the same person."""
        ...

    @property
    def max_speed(self) -> float:
        """Of people, m/s."""
        ...

    def message(self, degree: int) -> Message:
        """What it says in the first round, given how many neighbours hear it."""
        ...

    def accept(self, message: Message) -> None:
        """Take over what the last round left."""
        ...


def combine(own: Message, received: Sequence[Message], gate: float, max_speed: float = 3.0) -> Message:
    """What a UAV says in the next round, given what it and its neighbours said in this one.

    gate and max_speed are as `Member` has them.
    Each UAV hands a neighbour the share 1 / (1 + max(degrees)) of what it holds (Metropolis weights) and keeps the
    rest. So the fleet's sum is conserved, whatever ids it is filed under, where losses are mutual; in any case the
    ratio of weighted information to weight tends to a weighted average everywhere.
    Source: [Battistelli14], with weights that differ by UAV.
    Novel information is mixed likewise. Source: [Battistelli15].
    Note: instead of the number of UAVs, which makes up for the mixing of novel information, the shares of them all
    are mixed along. So nothing counts more than once where messages are lost, too, though some of it then counts less,
    and whoever has nothing to say does not dilute it.
    """
    if not received:
        return own
    return _Tables.of(aligned(own, received, gate, max_speed)).said(0, np.arange(1, 1 + len(received)))


@dataclass(frozen=True, eq=False)
class _Tables:
    """What N messages about the same T tracks say, side by side."""

    messages: Sequence[Message]
    degrees: Array  # (N,)
    shares: Array  # (N, T, W)
    novel: Array  # (N, T, V)
    times: Array  # (N, T, 3)
    agree: bool  # on whatever else a round may change

    @staticmethod
    def of(messages: Sequence[Message]) -> _Tables:
        # Columns stand for UAVs; whoever has not yet heard of the last ones lacks theirs.
        novel = np.zeros((len(messages), len(messages[0].ids), max(m.novel.shape[1] for m in messages)))
        for row, m in zip(novel, messages, strict=True):
            row[:, : m.novel.shape[1]] = m.novel
        return _Tables(
            messages,
            np.array([m.degree for m in messages], dtype=float),
            np.array([m.shares for m in messages]),
            novel,
            np.array([m.evidence.times for m in messages]),
            len({(m.counts, m.seen_at, m.company, m.met) for m in messages}) == 1,
        )

    def said(self, own: int, heard: Indices) -> Message:
        """What one of them says next, given which others it heard."""
        first = self.messages[own]
        divisors = 1.0 + np.maximum(self.degrees[own], self.degrees[heard])
        times = np.maximum(self.times[own], self.times[heard].max(axis=0))
        said = replace(
            first,
            shares=_mixed(self.shares, own, heard, divisors),
            evidence=replace(first.evidence, times=times),
            novel=_mixed(self.novel, own, heard, divisors) if self.novel.size else first.novel,
        )
        return said if self.agree else _settled(said, [first, *(self.messages[j] for j in heard.tolist())])


@compiled
def _mixed(table: Array, own: int, heard: Indices, divisors: Array) -> Array:
    """What one row of a table (N, T, W) holds when each of those heard has handed it its share of what they have more.

    heard (H,): their rows; divisors (H,): one over these shares.
    """
    count, tracks, width = table.shape
    rows = table.reshape(count, tracks * width)  # a plain row each, so that the innermost loop is vectorised
    out: Array = rows[own].copy()
    for k in range(len(heard)):
        there, here, divisor = rows[heard[k]], rows[own], divisors[k]
        for w in range(len(out)):
            out[w] += (there[w] - here[w]) / divisor
    return out.reshape(tracks, width)


def _settled(said: Message, messages: Sequence[Message]) -> Message:
    """The message with what those heard in this round, one's own first, say differently."""
    return replace(
        said,
        evidence=_agreed(said.evidence.times, messages),
        sightings=_latest(messages),
        company=min((m.company for m in messages), key=lambda company: (company[0], -company[1])),
        met=companies_meet(messages),
    )


def _agreed(times: Array, messages: Sequence[Message]) -> Evidence:
    """The latest times (T, 3) that any message knows of, and what counts against tracks, from whoever saw each last.

    Where UAVs were apart, those who missed a person whom others saw in the meantime have nothing against the track.
    """
    first = messages[0].evidence
    if all(m.counts == messages[0].counts for m in messages):
        return Evidence(times, first.misses, first.shared)
    misses, shared, seen, held = first.misses, first.shared, first.times[:, 0], messages[0].shares[:, 0] > 0.0
    for message in messages[1:]:
        its, holds = message.evidence, message.shares[:, 0] > 0.0
        fewer = (its.misses < misses) | ((its.misses == misses) & (its.shared < shared))
        better = holds & (~held | (its.times[:, 0] > seen) | ((its.times[:, 0] == seen) & fewer))
        misses, shared = np.where(better, its.misses, misses), np.where(better, its.shared, shared)
        seen, held = np.maximum(seen, its.times[:, 0]), held | holds
    return Evidence(times, misses, shared)


def _latest(messages: Sequence[Message]) -> Array:
    """For each track the latest sighting that any message knows of (T, 3)."""
    latest = messages[0].sightings
    for message in messages:
        if message.seen_at != messages[0].seen_at:
            later = message.sightings[:, 2:] > latest[:, 2:]
            latest = np.where(later, message.sightings, latest)
    return latest


def fuse(
    members: Sequence[Member],
    adjacency: NDArray[np.bool_],
    rounds: int,
    lost: NDArray[np.bool_] | None = None,
) -> NDArray[np.int64]:
    """Rounds of messages over the undirected graph `adjacency` (n, n), its diagonal aside; bytes sent by each (n,).

    lost (rounds, n, n): whether what UAV j says in a round is lost on its way to UAV i; nobody knows beforehand.
    Every scan ends with this, also for one UAV: tracks are ended here.
    """
    adjacency = _graph(adjacency, len(members))
    if type(rounds) is not int or rounds < 0:
        raise ValueError(f"rounds must be a whole number of at least 0, is {rounds!r}")
    if lost is not None and lost.shape != (rounds, *adjacency.shape):
        raise ValueError(f"lost must have shape {(rounds, *adjacency.shape)}, has {lost.shape}")
    linked = adjacency & ~np.eye(len(members), dtype=np.bool_)
    messages = [m.message(int(row.sum())) for m, row in zip(members, linked, strict=True)]
    _check(messages)
    sent = np.zeros(len(members), dtype=np.int64)
    for k in range(rounds):
        sent += [message.size if row.any() else 0 for message, row in zip(messages, linked, strict=True)]
        heard = linked if lost is None else linked & ~lost[k]
        messages = _after_a_round(members, messages, heard)
    for member, message in zip(members, messages, strict=True):
        member.accept(message)
    return sent


def _check(messages: Sequence[Message]) -> None:
    """Whether they can be understood together."""
    uavs = [m.uav for m in messages]
    if len(set(uavs)) < len(uavs):
        raise ValueError(f"uav must differ among members, are {uavs}")
    for setting, said in (
        ("life", {m.shares.shape[1] for m in messages}),
        ("fusion", {m.novel.shape[1] > 0 for m in messages}),
    ):
        if len(said) > 1:
            raise ValueError(f"{setting} must be the same for all members, is not")


def _after_a_round(members: Sequence[Member], messages: Sequence[Message], heard: NDArray[np.bool_]) -> list[Message]:
    """What all say next, given who heard whom (n, n)."""
    if not heard.any():
        return list(messages)
    rows = [np.flatnonzero(row) for row in heard]
    if not alike(messages):
        return [
            combine(messages[i], [messages[j] for j in row.tolist()], m.match_gate, m.max_speed)
            for i, (m, row) in enumerate(zip(members, rows, strict=True))
        ]
    # All call their tracks alike, so one table does for all of them.
    tables = _Tables.of(messages)
    return [tables.said(i, row) if len(row) else messages[i] for i, row in enumerate(rows)]


def _graph(adjacency: NDArray[np.bool_], count: int) -> NDArray[np.bool_]:
    """The graph, if it is one over so many UAVs."""
    graph = np.asarray(adjacency)
    if graph.shape != (count, count) or graph.dtype != np.bool_:
        raise ValueError(f"adjacency must be bool ({count}, {count}), is {graph.dtype} {graph.shape}")
    if not np.array_equal(graph, graph.T):
        raise ValueError("adjacency must be symmetric: who hears whom is heard by them")
    return graph
