"""Rounds of consensus on the columns of all messages of a fleet: weighted averages, and sums of novel information."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from tracking.fusion.message import EMPTY, Message, count_novel_numbers
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, merged
from tracking.track import SIGHTED_AT


class FleetColumns(NamedTuple):
    """Columns of N messages, as in `Message`; message n has the first `counts[n]` of the T rows.

    The last row of each is that of a track that the message lacks: it adds nothing to what others tell.
    """

    counts: Indices  # (N,)
    ids: Indices  # (N, T)
    keys: Indices  # (N, T, 2)
    shares: Array  # (N, T, 22)
    times: Array  # (N, T, 4)
    views: Indices  # (N, T, 2)
    misses: Indices  # (N, T)
    sightings: Array  # (N, T, 3)
    novel: Array  # (N, T, W), with the columns of the message that has most of them
    gained: Flags  # (N, T) set where there may be novel information; the others have zeros


def stack_messages(messages: Sequence[Message]) -> FleetColumns:
    """Columns of messages."""
    counts = np.array([len(m.ids) for m in messages])
    columns = make_columns(counts, 1 + int(counts.max(initial=0)), max(m.novel.shape[1] for m in messages))
    for n, (m, count) in enumerate(zip(messages, counts.tolist(), strict=True)):
        for name in EMPTY:
            if name != "novel":
                getattr(columns, name)[n, :count] = getattr(m, name)
    _stack_novel(messages, columns.novel)
    _find_gains(columns)
    return columns


def stack_alike(messages: Sequence[Message]) -> FleetColumns:
    """Columns of messages with the same tracks in the same rows, without a row of empty ones."""
    count, tracks = len(messages), len(messages[0].ids)
    counts, gained = np.full(count, tracks), np.empty((count, tracks), dtype=np.bool_)
    joint = {name: np.concatenate([getattr(m, name) for m in messages]) for name in EMPTY if name != "novel"}
    joint["novel"] = join_novel(messages)
    shaped = {name: column.reshape(count, tracks, *column.shape[1:]) for name, column in joint.items()}
    columns = FleetColumns(counts=counts, gained=gained, **shaped)
    _find_gains(columns)
    return columns


def _stack_novel(messages: Sequence[Message], novel: Array) -> None:
    for n, m in enumerate(messages):
        tracks, width = m.novel.shape
        novel[n, :tracks, :width], novel[n, :tracks, width:] = m.novel, 0.0


def join_novel(messages: Sequence[Message]) -> Array:
    """Novel information of messages, one after the other, with the columns of the message that has most of them."""
    width = max([m.novel.shape[1] for m in messages])
    ends = list(accumulate(len(m.ids) for m in messages))
    joint = np.zeros((ends[-1], width))
    for m, last in zip(messages, ends, strict=True):
        joint[last - len(m.ids) : last, : m.novel.shape[1]] = m.novel
    return joint


@compiled
def _find_gains(columns: FleetColumns) -> None:
    for n in range(len(columns.counts)):
        for t in range(columns.counts[n]):
            gained = False
            for w in range(columns.novel.shape[2]):
                gained |= columns.novel[n, t, w] != 0.0
            columns.gained[n, t] = gained


def make_columns(counts: Indices, rows: int, width: int) -> FleetColumns:
    """Columns, not yet filled, for messages with so many tracks (N,) in so many rows."""
    count = len(counts)
    made = FleetColumns(
        counts,
        ids=np.empty((count, rows), dtype=np.int64),
        keys=np.empty((count, rows, 2), dtype=np.int64),
        shares=np.empty((count, rows, 22)),
        times=np.empty((count, rows, 4)),
        views=np.empty((count, rows, 2), dtype=np.int64),
        misses=np.empty((count, rows), dtype=np.int64),
        sightings=np.empty((count, rows, 3)),
        novel=np.empty((count, rows, width)),
        gained=np.empty((count, rows), dtype=np.bool_),
    )
    for name, empty in EMPTY.items():
        getattr(made, name)[:, -1] = empty
    made.gained[:, -1] = False
    return made


def widen(columns: FleetColumns, rows: int) -> FleetColumns:
    """The columns with room for more tracks of each message."""
    wider = make_columns(columns.counts, rows, columns.novel.shape[2])
    for new, old in zip(wider[1:], columns[1:], strict=True):
        new[:, : old.shape[1] - 1] = old[:, :-1]
    return wider


@compiled
def mix_tracks(before: FleetColumns, after: FleetColumns, heard: Indices, rows: Indices, degrees: Array) -> None:
    """Mix the tracks of a UAV in a round: write its rows of the columns `after` the round but ids and keys.

    heard (H,): its message and those that it received, in the columns `before` the round; rows (H, T): row of each
    track in each of these, -1 for none, which is the empty row; degrees (N,): of all messages. A message hands over its
    share of the difference to the own columns. It also tells the latest times and sightings, all views, and the common
    misses.
    """
    i = heard[0]
    after.counts[i] = rows.shape[1]
    for t in range(rows.shape[1]):
        own, gained = rows[0, t], False
        for k in range(len(heard)):
            gained |= before.gained[heard[k], rows[k, t]]
        after.gained[i, t] = gained
        for w in range(before.shares.shape[2]):
            after.shares[i, t, w] = before.shares[i, own, w]
        for w in range(before.novel.shape[2]):
            after.novel[i, t, w] = before.novel[i, own, w]
        for k in range(1, len(heard)):
            j, r = heard[k], rows[k, t]
            divisor = 1.0 + max(degrees[i], degrees[j])
            for w in range(before.shares.shape[2]):
                after.shares[i, t, w] += (before.shares[j, r, w] - before.shares[i, own, w]) / divisor
            for w in range(before.novel.shape[2] if gained else 0):
                after.novel[i, t, w] += (before.novel[j, r, w] - before.novel[i, own, w]) / divisor
    _take_latest(before, after, heard, rows)


@merged
def _take_latest(before: FleetColumns, after: FleetColumns, heard: Indices, rows: Indices) -> None:
    """The part of `mix_tracks` that is not averaged."""
    i = heard[0]
    for t in range(rows.shape[1]):
        own = rows[0, t]
        after.misses[i, t] = before.misses[i, own]
        for c in range(2):
            after.views[i, t, c] = before.views[i, own, c]
        for c in range(4):
            after.times[i, t, c] = before.times[i, own, c]
        for c in range(3):
            after.sightings[i, t, c] = before.sightings[i, own, c]
        for k in range(1, len(heard)):
            j, r = heard[k], rows[k, t]
            after.misses[i, t] &= before.misses[j, r]
            for c in range(2):
                after.views[i, t, c] |= before.views[j, r, c]
            for c in range(4):
                after.times[i, t, c] = max(after.times[i, t, c], before.times[j, r, c])
            for c in range(3 if before.sightings[j, r, SIGHTED_AT] > after.sightings[i, t, SIGHTED_AT] else 0):
                after.sightings[i, t, c] = before.sightings[j, r, c]


@compiled
def mix_rounds(
    columns: FleetColumns, degrees: Array, heard: Flags
) -> tuple[tuple[Array, Array, Indices, Indices, Array, Array], Indices]:
    """Mix N messages with the same tracks in the same rows.

    degrees (N,); heard (R, N, N): flags of the UAVs that each UAV hears in each round.
    Returns `shares`, `times`, `views`, `misses`, `sightings` and `novel` of the columns after the rounds, and the
    numbers (N,) of novel information sent.
    """
    count, before = len(degrees), columns
    after = FleetColumns(
        before.counts.copy(),
        before.ids,
        before.keys,
        np.empty_like(before.shares),
        np.empty_like(before.times),
        np.empty_like(before.views),
        np.empty_like(before.misses),
        np.empty_like(before.sightings),
        np.empty_like(before.novel),
        np.empty_like(before.gained),
    )
    numbers, told = np.zeros(count, np.int64), np.empty(count, np.int64)
    rows = np.empty((count, columns.ids.shape[1]), np.int64)
    for i in range(count):
        for t in range(rows.shape[1]):
            rows[i, t] = t
    for k in range(len(heard)):
        numbers += count_novel(before)
        for i in range(count):
            told[0], messages = i, 1
            for j in range(count):
                if heard[k, i, j]:
                    told[messages] = j
                    messages += 1
            mix_tracks(before, after, told[:messages], rows[:messages], degrees)
        before, after = after, before
    return (before.shares, before.times, before.views, before.misses, before.sightings, before.novel), numbers


@compiled
def count_novel(columns: FleetColumns) -> Indices:
    """Count the numbers of novel information in each message (N,)."""
    numbers = np.zeros(len(columns.counts), np.int64)
    for n in range(len(numbers)):
        for t in range(columns.counts[n]):
            if columns.gained[n, t]:
                numbers[n] += count_novel_numbers(columns.novel[n, t : t + 1])
    return numbers
