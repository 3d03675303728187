"""Consensus by messages between neighbours: weighted averages of beliefs, and sums of novel information."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from tracking.fusion.message import Message, alike, partitions_meet
from tracking.fusion.track_association import associate_tracks
from tracking.management.deletion import DetectionHistory
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled


class Member(Protocol):
    """Participant in consensus."""

    @property
    def match_gate(self) -> float:
        """Largest squared distance between tracks of different ids that are associated."""
        ...

    @property
    def max_speed(self) -> float:
        """Largest speed of people, m/s."""
        ...

    def message(self, degree: int) -> Message:
        """Message for the first round, to so many neighbours."""
        ...

    def accept(self, message: Message) -> None:
        """Take over the result of the last round."""
        ...


def combine(own: Message, received: Sequence[Message], gate: float, max_speed: float = 3.0) -> Message:
    """Message of a UAV in the next round, from its own and its neighbours' in this one.

    gate and max_speed are `Member.match_gate` and `Member.max_speed`.
    Each UAV hands a neighbour the share 1 / (1 + max(degrees)) of its information (Metropolis weights) and keeps the
    rest. So the fleet's sum is conserved, under any ids, where losses are mutual. In any case the ratio of weighted
    information to weight tends to a weighted average everywhere.
    Source: [Battistelli14], with weights that differ by UAV.
    Novel information is mixed likewise. Source: [Battistelli15].
    Note: the shares of all UAVs are mixed along, in place of the factor of their number that undoes the mixing of
    novel information. So nothing counts more than once where messages are lost, though some of it then counts less.
    UAVs without novel information do not dilute it.
    """
    if not received:
        return own
    return _Tables.of(associate_tracks(own, received, gate, max_speed)).next_message(0, np.arange(1, 1 + len(received)))


@dataclass(frozen=True, eq=False)
class _Tables:
    """Contents of N messages about the same T tracks, side by side."""

    messages: Sequence[Message]
    degrees: Array  # (N,)
    shares: Array  # (N, T, W)
    novel: Array  # (N, T, V)
    times: Array  # (N, T, 3)
    agree: bool  # on all other contents that a round may change

    @staticmethod
    def of(messages: Sequence[Message]) -> _Tables:
        # Columns stand for UAVs; messages from UAVs that have not heard of the last ones lack theirs.
        novel = np.zeros((len(messages), len(messages[0].ids), max(m.novel.shape[1] for m in messages)))
        for row, m in zip(novel, messages, strict=True):
            row[:, : m.novel.shape[1]] = m.novel
        return _Tables(
            messages,
            np.array([m.degree for m in messages], dtype=float),
            np.array([m.shares for m in messages]),
            novel,
            np.array([m.history.times for m in messages]),
            len({(m.counts, m.sighting_times, m.partition, m.met) for m in messages}) == 1,
        )

    def next_message(self, own: int, heard: Indices) -> Message:
        """Next message of one of the UAVs after it heard some of the others."""
        first = self.messages[own]
        divisors = 1.0 + np.maximum(self.degrees[own], self.degrees[heard])
        times = np.maximum(self.times[own], self.times[heard].max(axis=0))
        mixed = replace(
            first,
            shares=_mixed(self.shares, own, heard, divisors),
            history=replace(first.history, times=times),
            novel=_mixed(self.novel, own, heard, divisors) if self.novel.size else first.novel,
        )
        return mixed if self.agree else _settled(mixed, [first, *(self.messages[j] for j in heard.tolist())])


@compiled
def _mixed(table: Array, own: int, heard: Indices, divisors: Array) -> Array:
    """Row `own` of a table (N, T, W) after each of the rows heard has handed over its share of the difference.

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


def _settled(mixed: Message, messages: Sequence[Message]) -> Message:
    """The mixed message with the contents on which the messages of this round, the own first, differ."""
    return replace(
        mixed,
        history=_agreed(mixed.history.times, messages),
        sightings=_latest(messages),
        partition=min((m.partition for m in messages), key=lambda partition: (partition[0], -partition[1])),
        met=partitions_meet(messages),
    )


def _agreed(times: Array, messages: Sequence[Message]) -> DetectionHistory:
    """History with the latest times (T, 3), and the counts of the message that saw each track last.

    Where the fleet was split, misses do not count if UAVs of another partition saw the person in the meantime.
    """
    first = messages[0].history
    if all(m.counts == messages[0].counts for m in messages):
        return DetectionHistory(times, first.misses, first.shared)
    misses, shared, seen, held = first.misses, first.shared, first.times[:, 0], messages[0].shares[:, 0] > 0.0
    for message in messages[1:]:
        its, holds = message.history, message.shares[:, 0] > 0.0
        fewer = (its.misses < misses) | ((its.misses == misses) & (its.shared < shared))
        better = holds & (~held | (its.times[:, 0] > seen) | ((its.times[:, 0] == seen) & fewer))
        misses, shared = np.where(better, its.misses, misses), np.where(better, its.shared, shared)
        seen, held = np.maximum(seen, its.times[:, 0]), held | holds
    return DetectionHistory(times, misses, shared)


def _latest(messages: Sequence[Message]) -> Array:
    """Latest sighting (T, 3) of each track in any message."""
    latest = messages[0].sightings
    for message in messages:
        if message.sighting_times != messages[0].sighting_times:
            later = message.sightings[:, 2:] > latest[:, 2:]
            latest = np.where(later, message.sightings, latest)
    return latest


def fuse(
    members: Sequence[Member],
    adjacency: Flags,
    rounds: int,
    lost: Flags | None = None,
) -> Indices:
    """Exchange rounds of messages over the undirected graph `adjacency` (n, n), its diagonal aside.

    lost (rounds, n, n): flags of the messages from UAV j that are lost on the way to UAV i, unknown beforehand.
    Every scan ends with this, also for one UAV: tracks are deleted here. Returns the bytes sent by each UAV (n,).
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
    """Raise ValueError for messages that do not fit together."""
    uavs = [m.uav for m in messages]
    if len(set(uavs)) < len(uavs):
        raise ValueError(f"uav must differ among members, are {uavs}")
    for setting, said in (
        ("life", {m.shares.shape[1] for m in messages}),
        ("fusion", {m.novel.shape[1] > 0 for m in messages}),
    ):
        if len(said) > 1:
            raise ValueError(f"{setting} must be the same for all members, is not")


def _after_a_round(members: Sequence[Member], messages: Sequence[Message], heard: Flags) -> list[Message]:
    """Messages of the next round; heard (n, n): row i has the UAVs that UAV i heard."""
    if not heard.any():
        return list(messages)
    rows = [np.flatnonzero(row) for row in heard]
    if not alike(messages):
        return [
            combine(messages[i], [messages[j] for j in row.tolist()], m.match_gate, m.max_speed)
            for i, (m, row) in enumerate(zip(members, rows, strict=True))
        ]
    # All messages are about the same tracks in the same rows, so one table serves for all of them.
    tables = _Tables.of(messages)
    return [tables.next_message(i, row) if len(row) else messages[i] for i, row in enumerate(rows)]


def _graph(adjacency: Flags, count: int) -> Flags:
    """The adjacency matrix of a graph over so many UAVs; ValueError for others."""
    graph = np.asarray(adjacency)
    if graph.shape != (count, count) or graph.dtype != np.bool_:
        raise ValueError(f"adjacency must be bool ({count}, {count}), is {graph.dtype} {graph.shape}")
    if not np.array_equal(graph, graph.T):
        raise ValueError("adjacency must be symmetric: UAVs hear one another or do not")
    return graph
