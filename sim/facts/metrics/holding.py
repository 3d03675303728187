"""States of people at each scan, given the tracks of a fleet (held, off, lost, not found yet), and spans of a state."""

from typing import NamedTuple

import numpy as np

from sim.facts.metrics.score import ELLIPSE, FAR
from sim.mission.snapshot import Snapshot
from tracking.metrics.clearmot import Matcher
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.distances import length, squared_distance
from tracking.track import beliefs_of


class Episode(NamedTuple):
    """A value that is the same from a first to a last scan, both included."""

    first: int
    last: int
    value: int


def find_episodes(values: Indices) -> list[Episode]:
    """Episodes of equal values (K,), in order of time."""
    edges = np.flatnonzero(np.diff(values)).tolist()
    firsts, lasts = [0, *(k + 1 for k in edges)], [*edges, len(values) - 1]
    return [Episode(a, b, int(values[a])) for a, b in zip(firsts, lasts, strict=True)]


HOLDS = ("absent", "not found yet", "lost", "off", "held by some", "held")
INSIDE, OUTSIDE, NO_TRACK = range(3)  # gaps of a person whom no UAV holds to the tracks that hold nobody


class Holding:
    """The states of M people during a mission; a reported track `within` m of a person holds that person."""

    def __init__(self, people: int, uavs: int, within: float) -> None:
        self._fleet = [(Matcher(people, within), dict[int, int]()) for _ in range(uavs)]  # with columns by track id
        self._found = np.zeros(people, dtype=np.bool_)

    def step(self, snapshot: Snapshot) -> Indices:
        """States (M,) at the next scan, as indices into `HOLDS`."""
        count, held = np.zeros(len(snapshot.people), dtype=np.int64), []
        for (matcher, columns), known in zip(self._fleet, snapshot.tracks, strict=True):
            reported = [track for track in known if track.reported]
            own = [columns.setdefault(track.id, len(columns)) for track in reported]
            places = np.full((len(columns), 2), np.nan)
            places[own] = np.array([track.belief.mean[:2] for track in reported]).reshape(-1, 2)
            matched = matcher.step(places, snapshot.people)
            count += matched >= 0
            held.append((reported, own, set(matched.tolist())))
        unheld, gaps = self._found & (count == 0), np.full(len(count), NO_TRACK)
        if unheld.any():
            free = [t for tracks, own, holding in held for t, at in zip(tracks, own, strict=True) if at not in holding]
            beliefs = beliefs_of(free)
            gaps[unheld] = find_gaps(snapshot.people[unheld], beliefs.means, beliefs.covariances)
        self._found |= count > 0
        return hold_states(count, self._found, len(snapshot.working), ~np.isnan(snapshot.people[:, 0]), gaps)


def find_gaps(people: Array, means: Array, covariances: Array) -> Indices:
    """Gap (M,) of each person to tracks within `FAR` m: `INSIDE` the 95 % ellipse of one, `OUTSIDE` it, or `NO_TRACK`.

    people (M, 2) m; means (A, 4) and covariances (A, 4, 4) of all UAVs' reported tracks that hold nobody.
    """
    errors, found = means[:, None, :2] - people, np.full(len(people), NO_TRACK)
    near = length(errors) < FAR
    found[near.any(axis=0)] = OUTSIDE
    inside = squared_distance(errors, covariances[:, None, :2, :2]) <= ELLIPSE**2
    found[(near & inside).any(axis=0)] = INSIDE
    return found


def hold_states(held: Indices, found: Flags, fleet: int | Indices, present: Flags, gaps: Indices) -> Indices:
    """States of people, as indices into `HOLDS`.

    held: number of UAVs that hold each person; found: True if held so far; fleet: number of working UAVs; gaps: as
    from `find_gaps`.
    """
    states = np.where(gaps == INSIDE, HOLDS.index("off"), HOLDS.index("lost"))
    states[~found] = HOLDS.index("not found yet")
    states[held > 0] = HOLDS.index("held by some")
    states[(held > 0) & (held == fleet)] = HOLDS.index("held")
    return np.where(present, states, HOLDS.index("absent"))
