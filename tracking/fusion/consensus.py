"""Consensus by messages between neighbours: weighted averages of beliefs, and sums of novel information."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tracking.fusion.member import Member, accept_messages, step_members
from tracking.fusion.message import EMPTY, EndedTrack, Message, Partition, are_alike, count_plain_numbers
from tracking.fusion.mixing import count_novel, make_columns, mix_rounds, mix_tracks, stack_alike, stack_messages, widen
from tracking.fusion.track_association import associate_tracks
from tracking.numerics.arrays import Flags, Indices
from tracking.track import Scan


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
    if rounds and linked.any():
        heard = np.repeat(linked[None], rounds, axis=0) if lost is None else np.ascontiguousarray(linked & ~lost)
        if are_alike(messages):  # and stay so
            messages, sizes = _mix_alike(messages, heard)
        else:
            fleet, sizes = _Fleet(messages), np.zeros_like(sent)
            for of in heard:
                sizes += fleet.sizes()
                fleet.mix(of, [member.max_speed for member in members])
            messages = [fleet.message(i) for i in range(len(members))]
        sent += linked.any(axis=1) * sizes
    accept_messages(members, messages)
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
    step_members(fleet, times[0], given)
    graph = ~np.eye(len(fleet), dtype=np.bool_) if adjacency is None else adjacency
    return fuse(fleet, graph, rounds, lost)


def pool(members: Sequence[Member]) -> Message:
    """The message for trackers in one place to accept, as after a round of `fuse` in which all hear each other."""
    first, *others = messages = [member.message(len(members) - 1) for member in members]
    _check(messages)
    return combine(first, others, members[0].max_speed)


def combine(own: Message, received: Sequence[Message], max_speed: float) -> Message:
    """Message of a UAV in the next round, from its own message and those received in this round."""
    if not received:
        return own
    fleet = _Fleet([own, *received])
    fleet.mix_first(max_speed)
    return fleet.message(0)


def _mix_alike(messages: Sequence[Message], heard: Flags) -> tuple[list[Message], Indices]:
    """Messages after R rounds, from N messages with the same tracks in the same rows, and bytes sent by each UAV (N,).

    heard (R, N, N): flags of the UAVs that each UAV heard in each round. One table serves all UAVs and rounds.
    """
    degrees = np.array([m.degree for m in messages], dtype=float)
    columns, numbers = mix_rounds(stack_alike(messages), degrees, heard)
    partitions = [m.partition for m in messages]
    for of in heard:
        if len(set(partitions)) > 1:
            partitions = [_join_partitions(partitions, known) for known in _list_heard(of)]
    mixed = [
        Message(m.uav, m.degree, m.scan, m.time, partition, m.ids, m.keys, q, t, v, n, s, m.deleted, added)
        for m, partition, q, t, v, n, s, added in zip(messages, partitions, *columns, strict=True)
    ]
    return mixed, 8 * (numbers + len(heard) * np.array([m.numbers for m in mixed]))


class _Fleet:
    """Messages of N UAVs in rounds of consensus, whose tracks have to be associated."""

    def __init__(self, messages: Sequence[Message]) -> None:
        self._said = messages  # before the first round
        self._degrees = np.array([m.degree for m in messages], dtype=float)
        self._partitions = [m.partition for m in messages]
        self._deleted = [m.deleted for m in messages]
        self._columns = columns = stack_messages(messages)
        # Rounds fill one set of columns from the other.
        self._after = make_columns(columns.counts.copy(), columns.ids.shape[1], columns.novel.shape[2])

    def sizes(self) -> Indices:
        """Bytes (N,) of the messages, as `Message.size`."""
        counts = zip(self._columns.counts.tolist(), self._deleted, strict=True)
        plain = np.array([count_plain_numbers(tracks, len(deleted)) for tracks, deleted in counts])
        return np.asarray(8 * (count_novel(self._columns) + plain))

    def mix(self, heard: Flags, max_speeds: Sequence[float]) -> None:
        """Go on by a round in which each UAV hears those of its row of `heard` (N, N)."""
        known = _list_heard(heard)
        self._deleted = [self._mix_one(of, speed) for of, speed in zip(known, max_speeds, strict=True)]
        self._partitions = [_join_partitions(self._partitions, of) for of in known]
        self._columns, self._after = self._after, self._columns

    def mix_first(self, max_speed: float) -> None:
        """As `mix` for the first UAV only, which hears all others."""
        known = list(range(len(self._said)))
        self._deleted[0] = self._mix_one(known, max_speed)
        self._partitions[0] = _join_partitions(self._partitions, known)
        self._columns, self._after = self._after, self._columns

    def _mix_one(self, known: list[int], max_speed: float) -> tuple[EndedTrack, ...]:
        """Mix the tracks of messages `known`, the first of which is the UAV's own; returns the deletions known then."""
        i, first = known[0], self._said[0]
        order = sorted(known, key=lambda k: self._said[k].uav)
        told = [self._deleted[k] for k in order]
        joint = associate_tracks(self._columns, order, told, (first.scan, first.time), max_speed)
        count = len(joint.ids)
        if count >= self._after.ids.shape[1]:
            self._columns, self._after = widen(self._columns, 1 + count), widen(self._after, 1 + count)
        rows = joint.rows if order == known else joint.rows[[order.index(k) for k in known]]
        mix_tracks(self._columns, self._after, np.array(known), rows, self._degrees)
        self._after.ids[i, :count], self._after.keys[i, :count] = joint.ids, joint.keys
        return joint.deleted

    def message(self, i: int) -> Message:
        """Message i in the next round."""
        columns, rows = self._columns, (i, slice(self._columns.counts[i]))
        told = {name: getattr(columns, name)[rows] for name in EMPTY}
        return replace(self._said[i], partition=self._partitions[i], deleted=self._deleted[i], **told)


def _list_heard(heard: Flags) -> list[list[int]]:
    """For each UAV itself, then those that it hears by its row of `heard` (N, N)."""
    return [[i, *(j for j, hears in enumerate(row) if hears)] for i, row in enumerate(heard.tolist())]


def _join_partitions(partitions: Sequence[Partition], known: list[int]) -> Partition:
    """The smallest leader that a UAV has or hears of, and the time of the leader's last message."""
    return min([partitions[k] for k in known], key=lambda partition: (partition.leader, -partition.time))


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
    linked = graph.copy()
    linked.ravel()[:: count + 1] = False
    return linked
