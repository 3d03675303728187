"""Consensus by messages between neighbours: weighted averages of beliefs, and sums of novel information."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tracking.fusion.member import Member
from tracking.fusion.message import Message, Partition, are_alike, count_novel_numbers
from tracking.fusion.track_association import associate_tracks
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
from tracking.track import SIGHTED_AT, Scan


class _LatestColumns(NamedTuple):
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
    linked = _check_adjacency(adjacency, len(members))
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


def step(
    fleet: Sequence[Member],
    scans: Sequence[Scan],
    adjacency: Flags | None = None,
    *,
    rounds: int = 5,
    lost: Flags | None = None,
    time: float | None = None,
) -> Indices:
    """Update trackers with their scans, predict the others to the scans' time, and fuse the tracks of all.

    Args:
        fleet: Trackers of n UAVs.
        scans: Scans of one time and of different UAVs.
        adjacency: Graph of communication (n, n) in the fleet's order; by default all UAVs hear each other.
        rounds: As in `fuse`.
        lost: As in `fuse`.
        time: Time of the scan [s], which is needed if there are no scans.

    Returns:
        Bytes (n,) that each UAV sends.
    """
    given = {scan.uav: scan for scan in scans}
    times = sorted({scan.time for scan in scans} | ({time} if time is not None else set()))
    if len(times) != 1 or len(given) != len(scans):
        raise ValueError(
            f"scans must be of one time and of different UAVs, are at {times} s of {[s.uav for s in scans]}"
        )
    unknown = set(given) - {tracker.uav for tracker in fleet}
    if unknown:
        raise ValueError(f"scans of UAVs {sorted(unknown)}, of which the fleet has no tracker")
    for tracker in fleet:
        if tracker.uav in given:
            tracker.step(given[tracker.uav])
        else:
            tracker.coast(times[0])
    complete = ~np.eye(len(fleet), dtype=np.bool_)
    return fuse(fleet, complete if adjacency is None else adjacency, rounds, lost)


def pool(members: Sequence[Member]) -> Message:
    """The message for trackers in one place to accept, as after a round of `fuse` in which all hear each other."""
    first, *others = messages = [member.message(len(members) - 1) for member in members]
    _check(messages)
    return combine(first, others, members[0].max_speed)


def combine(own: Message, received: Sequence[Message], max_speed: float) -> Message:
    """Message of a UAV in the next round, from its own message and those received in this round."""
    if not received:
        return own
    messages = [own, *received]
    joint = associate_tracks(messages, max_speed)
    novel = np.zeros((len(joint.ids), max(m.novel.shape[1] for m in messages)))
    partition = _join_partitions([m.partition for m in messages])
    rest = {"ids": joint.ids, "keys": joint.keys, "deleted": joint.deleted, "partition": partition, "novel": novel}
    mixed = own.select(joint.rows[0], **rest)
    there = joint.rows[0] >= 0
    novel[there, : own.novel.shape[1]] = own.novel[joint.rows[0][there]]
    shares, before, kept = mixed.shares.copy(), novel.copy(), _read_latest(mixed)
    for m, rows in zip(received, joint.rows[1:], strict=True):
        divisor = 1.0 + max(own.degree, m.degree)
        _add_shares(mixed.shares, shares, m.shares, rows, divisor)
        _add_shares(novel, before, m.novel, rows, divisor)
        _take_latest(kept, _read_latest(m), rows)
    return mixed


def _mix(messages: Sequence[Message], heard: Flags) -> tuple[list[Message], Indices]:
    """Messages after R rounds, from N messages with the same tracks in the same rows, and bytes sent by each UAV (N,).

    heard (R, N, N): flags of the UAVs that each UAV heard in each round.
    """
    # Columns of shares stand for UAVs; a message lacks the columns of the last UAVs if it holds none of their shares.
    novel = np.zeros((len(messages), len(messages[0].ids), max(m.novel.shape[1] for m in messages)))
    for row, m in zip(novel, messages, strict=True):
        row[:, : m.novel.shape[1]] = m.novel
    degrees = np.array([m.degree for m in messages], dtype=float)
    shares = np.array([m.shares for m in messages])
    kept = _LatestColumns(*map(np.array, zip(*map(_read_latest, messages), strict=True)))
    novel, shares, kept, numbers = _run_rounds(novel, shares, kept, degrees, heard)
    partitions = [m.partition for m in messages]
    for of in heard:
        if len(set(partitions)) > 1:
            known = [
                [partitions[i], *(partitions[j] for j in np.flatnonzero(row).tolist())] for i, row in enumerate(of)
            ]
            partitions = list(map(_join_partitions, known))
    mixed = [
        Message(m.uav, m.degree, m.scan, m.time, partition, m.ids, m.keys, q, t, v, n, s, m.deleted, added)
        for m, partition, q, added, t, v, n, s in zip(messages, partitions, shares, novel, *kept, strict=True)
    ]
    return mixed, 8 * (numbers + len(heard) * np.array([m.numbers for m in mixed]))


def _read_latest(m: Message) -> _LatestColumns:
    return _LatestColumns(m.times, m.views, m.misses, m.sightings)


def _join_partitions(partitions: Sequence[Partition]) -> Partition:
    """The smallest leader that a UAV has or hears of, and the time of the leader's last message."""
    return min(partitions, key=lambda partition: (partition.leader, -partition.time))


@compiled
def _run_rounds(
    novel: Array, shares: Array, kept: _LatestColumns, degrees: Array, heard: Flags
) -> tuple[Array, Array, _LatestColumns, Indices]:
    """Columns of N messages after rounds `heard` (R, N, N), and count (N,) of the numbers of novel information sent."""
    (count, tracks, width), columns = novel.shape, shares.shape[2]
    rows, single, numbers = np.arange(tracks), np.zeros(1, np.int64), np.zeros(count, np.int64)
    # All tracks of a message as one row, because the innermost loop is fast.
    novel = novel.reshape(count, 1, tracks * width)
    shares = shares.reshape(count, 1, tracks * columns)
    for k in range(len(heard)):
        sums, added = shares.copy(), novel.copy()
        times, views, misses, sightings = kept
        latest = _LatestColumns(times.copy(), views.copy(), misses.copy(), sightings.copy())
        for i in range(count):
            numbers[i] += count_novel_numbers(novel[i].reshape(tracks, width))
            for j in range(count):
                if heard[k, i, j]:
                    divisor = 1.0 + max(degrees[i], degrees[j])
                    _add_shares(sums[i], shares[i], shares[j], single, divisor)
                    _add_shares(added[i], novel[i], novel[j], single, divisor)
                    ours = _LatestColumns(latest.times[i], latest.views[i], latest.misses[i], latest.sightings[i])
                    _take_latest(ours, _LatestColumns(times[j], views[j], misses[j], sightings[j]), rows)
        novel, shares, kept = added, sums, latest
    return novel.reshape(count, tracks, width), shares.reshape(count, tracks, columns), kept, numbers


@compiled
def _add_shares(sums: Array, here: Array, there: Array, rows: Indices, divisor: float) -> None:
    """Add to sums (T, W) what a message hands over: its share of the difference to the table `here` (T, W).

    rows (T,): the message's row in its table `there` for each track; -1 for none, which counts as zeros.
    """
    for t in range(len(rows)):
        known, total, own = 0, sums[t], here[t]
        if rows[t] >= 0:
            known, other = there.shape[1], there[rows[t]]
            for w in range(known):
                total[w] += (other[w] - own[w]) / divisor
        for w in range(known, len(own)):
            total[w] += (0.0 - own[w]) / divisor


@compiled
def _take_latest(latest: _LatestColumns, heard: _LatestColumns, rows: Indices) -> None:
    """Take over from a message the latest times and sightings, all views, and the common misses; rows as above."""
    for t in range(len(rows)):
        r = rows[t]
        if r < 0:
            continue
        for c in range(4):
            latest.times[t, c] = max(latest.times[t, c], heard.times[r, c])
        latest.views[t, 0] |= heard.views[r, 0]
        latest.views[t, 1] |= heard.views[r, 1]
        latest.misses[t] &= heard.misses[r]
        for c in range(3 if heard.sightings[r, SIGHTED_AT] > latest.sightings[t, SIGHTED_AT] else 0):
            latest.sightings[t, c] = heard.sightings[r, c]


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


def _check_adjacency(adjacency: Flags, count: int) -> Flags:
    """The adjacency matrix of a graph over `count` UAVs with a false diagonal; ValueError if it is no such matrix."""
    graph = np.asarray(adjacency)
    if graph.shape != (count, count) or graph.dtype != np.bool_:
        raise ValueError(f"adjacency must be bool ({count}, {count}), is {graph.dtype} {graph.shape}")
    if (graph != graph.T).any():
        raise ValueError("adjacency must be symmetric: UAVs hear one another or do not")
    return graph & ~np.eye(count, dtype=np.bool_)
