"""States of people at each scan, given the tracks of a fleet (held, lost or not found yet), and spans of one state."""

from typing import NamedTuple

import numpy as np

from sim.evaluation.score import HELD
from sim.mission.snapshot import Snapshot, find_reported_positions
from tracking.metrics.clearmot import Matcher
from tracking.numerics.arrays import Flags, Indices


class Episode(NamedTuple):
    """A value that is the same from a first to a last scan, both included."""

    first: int
    last: int
    value: int


def episodes(values: Indices) -> list[Episode]:
    """Episodes of equal values (K,), in order of time."""
    edges = np.flatnonzero(np.diff(values)).tolist()
    firsts, lasts = [0, *(k + 1 for k in edges)], [*edges, len(values) - 1]
    return [Episode(a, b, int(values[a])) for a, b in zip(firsts, lasts, strict=True)]


HOLDS = ("absent", "not found yet", "lost", "held by some", "held")


class Holding:
    """The states of M people during a mission; a reported track within `HELD` m of a person holds that person."""

    def __init__(self, people: int, uavs: int) -> None:
        self._fleet = [(Matcher(people, HELD), dict[int, int]()) for _ in range(uavs)]  # with columns by track id
        self._found = np.zeros(people, dtype=np.bool_)

    def step(self, snapshot: Snapshot) -> Indices:
        """States (M,) at the next scan, as indices into `HOLDS`."""
        count = np.zeros(len(snapshot.people), dtype=np.int64)
        for (matcher, columns), known in zip(self._fleet, snapshot.tracks, strict=True):
            own = [columns.setdefault(track.id, len(columns)) for track in known if track.reported]
            places = np.full((len(columns), 2), np.nan)
            places[own] = find_reported_positions(known)
            count += matcher.step(places, snapshot.people) >= 0
        self._found |= count > 0
        return hold_states(count, self._found, len(snapshot.working), ~np.isnan(snapshot.people[:, 0]))


def hold_states(held: Indices, found: Flags, fleet: int | Indices, present: Flags) -> Indices:
    """States of people, as indices into `HOLDS`.

    held: number of UAVs that hold each person; found: True if held so far; fleet: number of working UAVs.
    """
    states = np.where(found, HOLDS.index("lost"), HOLDS.index("not found yet"))
    states[held > 0] = HOLDS.index("held by some")
    states[(held > 0) & (held == fleet)] = HOLDS.index("held")
    return np.where(present, states, HOLDS.index("absent"))
