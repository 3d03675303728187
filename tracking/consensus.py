"""Kullback-Leibler average of the beliefs of those UAVs that saw a target, by messages between neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracking.identity import Message, aligned


class Member(Protocol):
    """What takes part in consensus."""

    @property
    def match_gate(self) -> float:
        """Largest squared distance at which tracks of different ids are taken for the same person."""
        ...

    def message(self, degree: int) -> Message:
        """What it says in the first round, given how many neighbours hear it."""
        ...

    def accept(self, message: Message) -> None:
        """Take over what the last round left."""
        ...


def combine(own: Message, received: Sequence[Message], gate: float) -> Message:
    """What a UAV says in the next round, given what it and its neighbours said in this one.

    gate is as `Member.match_gate`.
    Each UAV hands a neighbour the share 1 / (1 + max(degrees)) of what it holds (Metropolis weights) and keeps the
    rest, so the fleet's sum is conserved, whatever ids it is filed under, and the ratio of weighted information to
    weight tends to the weighted average everywhere. Source: [Battistelli14], with weights that differ by UAV.
    """
    if not received:
        return own
    own, *received = aligned(own, received, gate)
    shares, times = own.shares.copy(), own.evidence.times
    for message in received:
        shares += (message.shares - own.shares) / (1 + max(own.degree, message.degree))
        times = np.maximum(times, message.evidence.times)
    return replace(own, shares=shares, evidence=replace(own.evidence, times=times))


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
            combine(messages[i], [messages[j] for j in np.flatnonzero(row).tolist()], members[i].match_gate)
            for i, row in enumerate(heard)
        ]
    for member, message in zip(members, messages, strict=True):
        member.accept(message)
    return sent
