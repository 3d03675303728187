"""Stretches of time in which nothing changed for a person: in one camera, and in the fleet's tracks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.mission.snapshot import Ints
from sim.replay.history import STATES, History

BROKEN = -1  # stands for a UAV that has broken down where others have a state
HOLDS = ("absent", "not found yet", "lost", "held by some", "held")


class Episode(NamedTuple):
    """A value that is the same from one scan to another, both included."""

    first: int
    last: int
    value: int


def episodes(values: Ints) -> list[Episode]:
    """The stretches (K,) falls into."""
    edges = np.flatnonzero(np.diff(values)).tolist()
    firsts, lasts = [0, *(k + 1 for k in edges)], [*edges, len(values) - 1]
    return [Episode(a, b, int(values[a])) for a, b in zip(firsts, lasts, strict=True)]


def trees(history: History) -> Ints:
    """The tree between each camera and each person in its last frame (K, n, M); -1 for none."""
    return np.asarray(np.take_along_axis(history.hidden_by, last_looks(history)[:, :, None], axis=0), dtype=np.int64)


def lanes(history: History) -> Ints:
    """What each camera made of each person (K, n, M), an index into `STATES`, or `BROKEN`.

    Between its frames a camera that is slower than the others has what its last frame had.
    """
    names = {name: n for n, name in enumerate(STATES)}
    found = np.full(history.inside.shape, names["out of view"])
    for name, told in (("hidden", history.inside), ("missed", history.shown), ("seen", history.detected)):
        found[told] = names[name]
    found = np.take_along_axis(found, last_looks(history)[:, :, None], axis=0)
    found[np.broadcast_to(~history.present[:, None], found.shape)] = names["absent"]
    found[~history.working] = BROKEN
    return found


def last_looks(history: History) -> Ints:
    """The last scan up to each at which a UAV's camera took a frame (K, n); 0 before the first."""
    scans = np.arange(len(history.times))[:, None]
    return np.asarray(np.maximum.accumulate(np.where(history.looked, scans, 0), axis=0), dtype=np.int64)


def holds(history: History) -> Ints:
    """What the fleet's tracks made of each person (K, M), an index into `HOLDS`: of the UAVs that work, who held them.

    Without a UAV that works, nobody holds anybody.
    """
    fleet = np.count_nonzero(history.working, axis=1)[:, None]
    before = np.maximum.accumulate(history.held > 0, axis=0)
    state = np.where(before, HOLDS.index("lost"), HOLDS.index("not found yet"))
    state[history.held > 0] = HOLDS.index("held by some")
    state[(history.held == fleet) & (fleet > 0)] = HOLDS.index("held")
    state[~history.present] = HOLDS.index("absent")
    return np.asarray(state, dtype=np.int64)


def switches(history: History, person: int) -> list[int]:
    """Scans at which a UAV first held a person by another track than before, in order."""
    found: set[int] = set()
    for column in history.tracks[:, :, person].T:
        held = np.flatnonzero(column >= 0)
        found.update(held[1:][np.diff(column[held]) != 0].tolist())
    return sorted(found)
