"""Kullback-Leibler average of the beliefs of those UAVs that saw a target, by messages between neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracking.compiled import Array
from tracking.identity import Message
from tracking.roster import aligned


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
    rest, so the fleet's sum is conserved, whatever ids it is filed under, and the ratio of weighted information to
    weight tends to the weighted average everywhere. Source: [Battistelli14], with weights that differ by UAV.
    Novel information is mixed likewise. Source: [Battistelli15].
    Note: instead of the number of UAVs, which makes up for the mixing of novel information, the shares of them all
    are mixed along. So it is exact where messages are lost, too, and whoever has nothing to say does not dilute it.
    """
    if not received:
        return own
    own, *received = aligned(own, received, gate, max_speed)
    shares = own.shares.copy()
    for message in received:
        shares += (message.shares - own.shares) / (1 + max(own.degree, message.degree))
    every = [own, *received]
    times = np.maximum.reduce([m.evidence.times for m in every])
    return replace(
        own,
        shares=shares,
        evidence=replace(own.evidence, times=times),
        sightings=_latest(every),
        novel=_mixed(every),
        company=min((m.company for m in every), key=lambda company: (company[0], -company[1])),
    )


def _mixed(messages: Sequence[Message]) -> Array:
    """The novel part that the first one holds after a round, given what it and its neighbours held."""
    own, *received = messages
    width = max(m.novel.shape[1] for m in messages)
    if width == 0:
        return own.novel
    weights = [1.0 / (1 + max(own.degree, m.degree)) for m in received]
    # Columns stand for UAVs; whoever has not yet heard of the last ones lacks theirs.
    stacked = np.zeros((len(messages), len(own.ids), width))
    for row, m in zip(stacked, messages, strict=True):
        row[:, : m.novel.shape[1]] = m.novel
    return np.asarray(np.tensordot([1.0 - sum(weights), *weights], stacked, 1))


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
    linked = adjacency & ~np.eye(len(members), dtype=np.bool_)
    messages = [m.message(int(row.sum())) for m, row in zip(members, linked, strict=True)]
    sent = np.zeros(len(members), dtype=np.int64)
    for k in range(rounds):
        sent += [message.size if row.any() else 0 for message, row in zip(messages, linked, strict=True)]
        heard = linked if lost is None else linked & ~lost[k]
        messages = [
            combine(messages[i], [messages[j] for j in np.flatnonzero(row).tolist()], m.match_gate, m.max_speed)
            for i, (m, row) in enumerate(zip(members, heard, strict=True))
        ]
    for member, message in zip(members, messages, strict=True):
        member.accept(message)
    return sent
