"""States of people to the tracks of a fleet, scan by scan: held, lost, or not found yet."""

from __future__ import annotations

import numpy as np

from sim.evaluation.score import HELD
from sim.mission.snapshot import Ints, Snapshot
from tracking.metrics.clearmot import Matcher
from tracking.numerics.arrays import Array
from tracking.tracker import Track

HOLDS = ("absent", "not found yet", "lost", "held by some", "held")


class Holding:
    """The states of M people while a mission flies; a track within `HELD` m holds a person."""

    def __init__(self, people: int, uavs: int) -> None:
        self._fleet = [_Correspondence(people) for _ in range(uavs)]
        self._found = np.zeros(people, dtype=np.bool_)

    def step(self, snapshot: Snapshot) -> Ints:
        """The states (M,) at the next scan, indices into `HOLDS`."""
        matches = [own.step(tracks, snapshot.people) for own, tracks in zip(self._fleet, snapshot.tracks, strict=True)]
        count = np.count_nonzero(np.array(matches) >= 0, axis=0)
        self._found |= count > 0
        states = hold_states(count, self._found, len(snapshot.working))
        states[np.isnan(snapshot.people[:, 0])] = HOLDS.index("absent")
        return states


def hold_states(held: Ints, found: Ints | np.ndarray, fleet: int | Ints) -> Ints:
    """States, indices into `HOLDS`, of present people.

    held: by how many UAVs; found: they have been held before; fleet: UAVs that work.
    """
    states = np.where(found, HOLDS.index("lost"), HOLDS.index("not found yet"))
    states[held > 0] = HOLDS.index("held by some")
    states[(held > 0) & (held == fleet)] = HOLDS.index("held")
    return np.asarray(states, dtype=np.int64)


class _Correspondence:
    """The correspondence of people and the tracks of one UAV."""

    def __init__(self, people: int) -> None:
        self._matcher, self._columns = Matcher(people, HELD), dict[int, int]()

    def step(self, tracks: tuple[Track, ...], people: Array) -> Ints:
        """The track of each person (M,) at the next scan, a number; -1 for none."""
        columns = [self._columns.setdefault(track.id, len(self._columns)) for track in tracks]
        places = np.full((len(self._columns), 2), np.nan)
        places[columns] = np.array([track.belief.mean[:2] for track in tracks]).reshape(-1, 2)
        return self._matcher.step(places, people)
