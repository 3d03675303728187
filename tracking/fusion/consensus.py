"""Consensus by messages between neighbours: weighted averages of beliefs, and sums of novel information."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tracking.fusion.member import Member
from tracking.fusion.message import Message, Partition, are_alike, count_novel_numbers
from tracking.fusion.track_association import associate_tracks
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
from tracking.track import SIGHTED_AT


class _History(NamedTuple):
    """Columns of N messages that are not averaged."""

    times: Array  # (N, T, 4)
    views: Indices  # (N, T, 2)
    misses: Indices  # (N, T)
    sightings: Array  # (N, T, 3)


def fuse(members: Sequence[Member], adjacency: Flags, rounds: int, lost: Flags | None = None) -> Indices:
    """Exchange rounds of messages over the undirected graph `adjacency` (n, n); its diagonal is ignored.

    Each UAV hands each neighbour the share 1 / (1 + max(degrees)) of its information (Metropolis weights). Every scan
    ends with this call, even for one UAV, because it also deletes tracks. Returns the bytes sent by each UAV (n,).
    lost (rounds, n, n): flags of the messages from UAV j to UAV i that are lost, which no UAV knows beforehand.
    Source: [Battistelli14], with weights that differ by UAV, and [Battistelli15].

    Note: the sum of novel information is recovered by mixing each UAV's share as well, rather than by the number of
    UAVs as a factor, so that no information counts more than once if messages are lost.
    """
    linked = _links(adjacency, len(members))
    if type(rounds) is not int or rounds < 0:
        raise ValueError(f"rounds must be a whole number of at least 0, is {rounds!r}")
    if lost is not None and lost.shape != (rounds, *linked.shape):
        raise ValueError(f"lost must have shape {(rounds, *linked.shape)}, has {lost.shape}")
    messages = [m.message(row.count(True)) for m, row in zip(members, linked.tolist(), strict=True)]
    _check(messages)
    sent = np.zeros(len(members), dtype=np.int64)
    heard = np.repeat(linked[None], rounds, axis=0) if lost is None else np.ascontiguousarray(linked & ~lost)
    sends, k = linked.any(axis=1), 0
    while k < rounds and not are_alike(messages):
        sent += sends * np.array([message.size for message in messages])
        messages = [
            combine(own, [messages[j] for j in np.flatnonzero(row).tolist()], member.max_speed)
            for own, member, row in zip(messages, members, heard[k], strict=True)
        ]
        k += 1
    if k < rounds and sends.any():  # one table serves all UAVs and rounds
        messages, sizes = _mix(messages, heard[k:])
        sent += sends * sizes
    for member, message in zip(members, messages, strict=True):
        member.accept(message)
    return sent


def combine(own: Message, received: Sequence[Message], max_speed: float) -> Message:
    """Message of a UAV in the next round, from its own message and those received in this round."""
    if not received:
        return own
    same = associate_tracks(own, received, max_speed)
    return _mix(same, np.arange(len(same))[None, None] > 0)[0][0]


def _mix(messages: Sequence[Message], heard: Flags) -> tuple[list[Message], Indices]:
    """Messages after R rounds, from N messages with the same tracks in the same rows, and bytes sent by each UAV (M,).

    heard (R, M, N): flags of the UAVs that each of the first M UAVs heard in each round. If M is less than N, there is
    one round.
    """
    # Columns of shares stand for UAVs; a message lacks the columns of the last UAVs if it holds none of their shares.
    novel = np.zeros((len(messages), len(messages[0].ids), max(m.novel.shape[1] for m in messages)))
    for row, m in zip(novel, messages, strict=True):
        row[:, : m.novel.shape[1]] = m.novel
    degrees = np.array([m.degree for m in messages], dtype=float)
    shares = np.array([m.shares for m in messages])
    history = _History(*(np.array([getattr(m, name) for m in messages]) for name in _History._fields))
    novel, shares, history, numbers = _after_rounds(novel, shares, history, degrees, heard)
    partitions = [m.partition for m in messages]
    for of in heard:
        if len(set(partitions)) > 1:
            partitions = _joint_partitions(partitions, of)
    mixed = [
        Message(m.uav, m.degree, m.scan, m.time, partition, m.ids, m.keys, q, t, v, n, s, m.deleted, added)
        for m, partition, q, added, t, v, n, s in zip(messages, partitions, shares, novel, *history, strict=False)
    ]
    return mixed, 8 * (numbers + len(heard) * np.array([m.numbers for m in mixed]))


@compiled
def _after_rounds(
    novel: Array, shares: Array, history: _History, degrees: Array, heard: Flags
) -> tuple[Array, Array, _History, Indices]:
    """Columns of M messages after rounds `heard` (R, M, N), and count (M,) of the numbers of novel information sent."""
    numbers = np.zeros(heard.shape[1], np.int64)
    for k in range(len(heard)):
        for i in range(len(numbers)):
            numbers[i] += count_novel_numbers(novel[i])
        shares = _average(shares, degrees, heard[k])
        novel = _average(novel, degrees, heard[k])
        history = _take_latest(history, heard[k])
    return novel[: len(numbers)], shares, history, numbers


def _joint_partitions(partitions: Sequence[Partition], heard: Flags) -> list[Partition]:
    """Partition of each UAV: the smallest leader that it has or hears of, and the time of the leader's last message."""
    known = [[partitions[i], *(partitions[j] for j in np.flatnonzero(row).tolist())] for i, row in enumerate(heard)]
    return [min(each, key=lambda partition: (partition.leader, -partition.time)) for each in known]


@compiled
def _average(tables: Array, degrees: Array, heard: Flags) -> Array:
    """Tables (M, T, W) after one round: each UAV heard hands over its share of the difference of tables (N, T, W)."""
    count, tracks, width = tables.shape
    rows = tables.reshape(count, tracks * width)  # plain rows, so that the innermost loop is vectorised
    out = rows[: len(heard)].copy()
    for i in range(len(heard)):
        for j in range(count):
            if heard[i, j]:
                there, here, divisor = rows[j], rows[i], 1.0 + max(degrees[i], degrees[j])
                for w in range(len(there)):
                    out[i, w] += (there[w] - here[w]) / divisor
    return out.reshape(len(heard), tracks, width)


@compiled
def _take_latest(history: _History, heard: Flags) -> _History:
    """History of M messages after one round: the latest times and sightings, all views, and the common misses."""
    times, views, misses, sightings = history
    last, seen = times[: len(heard)].copy(), views[: len(heard)].copy()
    common, places = misses[: len(heard)].copy(), sightings[: len(heard)].copy()
    for i in range(len(heard)):
        for j in range(len(times)):
            if heard[i, j]:
                for t in range(times.shape[1]):
                    for c in range(4):
                        last[i, t, c] = max(last[i, t, c], times[j, t, c])
                    seen[i, t, 0] |= views[j, t, 0]
                    seen[i, t, 1] |= views[j, t, 1]
                    common[i, t] &= misses[j, t]
                    for c in range(3 if sightings[j, t, SIGHTED_AT] > places[i, t, SIGHTED_AT] else 0):
                        places[i, t, c] = sightings[j, t, c]
    return _History(last, seen, common, places)


def _check(messages: Sequence[Message]) -> None:
    """Raise ValueError if messages do not fit together."""
    uavs = [m.uav for m in messages]
    if len(set(uavs)) < len(uavs):
        raise ValueError(f"uav must differ among members, are {uavs}")
    if len({(m.scan, m.time) for m in messages}) > 1:
        raise ValueError(
            f"messages must be of one scan, are of scans {[(m.scan, m.time) for m in messages]} (number, s)"
        )
    if len({m.novel.shape[1] > 0 for m in messages}) > 1:
        raise ValueError("fusion must be the same for all members, is not")


def _links(adjacency: Flags, count: int) -> Flags:
    """The adjacency matrix of a graph over `count` UAVs with a false diagonal; ValueError if it is no such matrix."""
    graph = np.asarray(adjacency)
    if graph.shape != (count, count) or graph.dtype != np.bool_:
        raise ValueError(f"adjacency must be bool ({count}, {count}), is {graph.dtype} {graph.shape}")
    if (graph != graph.T).any():
        raise ValueError("adjacency must be symmetric: UAVs hear one another or do not")
    return graph & ~np.eye(count, dtype=np.bool_)
