"""Who holds whom: the home of this law, of its states, and of the words for them.

A UAV holds a person by a track that it reports within `Scenario.loss_distance` of them, as CLEAR MOT pairs tracks and
people from scan to scan. `Holding` says so scan by scan; `find_holding` lets it go through a recording.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sim.mission.recording import Recording
from tracking.metrics.clearmot import Matcher
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.distances import length, squared_distance
from tracking.track import Track, beliefs_of

FAR = 10.0  # m, distance beyond which a track belongs to no person: cut-off of GOSPA
ELLIPSE = math.sqrt(-2 * math.log(1 - 0.95))  # standard deviations that contain 95 % of a planar Gaussian

# The state of a person to the tracks of a fleet at a scan, with what it means. Everything that tells people's states in
# words takes them from here; tracks are those that are reported.
HOLD_MEANINGS = {
    "absent": "is not in the area",
    "not found yet": "no UAV has held them so far",
    "lost": "held before; no UAV holds them, and no track within 10 m that holds nobody has them in its 95 % ellipse",
    "off the track": "held before; no UAV holds them, but such a track has them in its ellipse",
    "held by some": "some of the working UAVs hold them",
    "held": "all working UAVs hold them",
}
HOLDS = tuple(HOLD_MEANINGS)
GRADES = ("lost", "not found yet", "off the track")  # states in which no UAV holds a person, the worst first
INSIDE, OUTSIDE, NO_TRACK = range(3)  # gap between a person without a track and the tracks that hold nobody


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


class Unheld(NamedTuple):
    """A loss: a span in which no UAV held a person who was there, with one grade."""

    person: int
    grade: str  # one of `GRADES`
    first: int  # scan
    last: int  # scan, included; the grade may change at the next one
    since: int  # first of all scans up to these at which no UAV held the person
    # scans without a track that holds nobody within `FAR` m, outside the 95 % ellipse of each such track, and inside
    scans: tuple[int, int, int]

    @property
    def found(self) -> bool:
        """True if the person was held before; otherwise no UAV has found them yet."""
        return self.grade != "not found yet"


class Reports(NamedTuple):
    """The tracks that one UAV reports at one scan."""

    ids: Indices  # (A,)
    means: Array  # (A, 4) m, m/s
    covariances: Array  # (A, 4, 4)


class Held(NamedTuple):
    """Who holds whom at one scan; of a recording each table has one row more in front, for each of K scans."""

    tracks: Indices  # (n, M), id of each UAV's track of each person; -1 for none
    gaps: Indices  # (M,), as from `find_gaps`, of the people whom no UAV holds
    states: Indices  # (M,), indices into `HOLDS`


class Holding:
    """The law, scan by scan, for M people and n UAVs."""

    def __init__(self, people: int, uavs: int, within: float) -> None:
        """Begin before the first scan; `within` m of a person a track can hold them."""
        self._matchers = [Matcher(people, within) for _ in range(uavs)]
        self._columns: list[dict[int, int]] = [{} for _ in range(uavs)]  # of the matchers, by the tracks' ids
        self._found = np.zeros(people, dtype=np.bool_)

    def step(self, people: Array, fleet: Sequence[Reports], working: int) -> Held:
        """Who holds whom at the next scan; people (M, 2) m, NaN where absent; `working`: number of UAVs that work."""
        tracks = np.full((len(fleet), len(people)), -1)
        free = []
        for i, own in enumerate(fleet):
            columns = self._columns[i]
            at = [columns.setdefault(id_, len(columns)) for id_ in own.ids.tolist()]
            places = np.full((len(columns), 2), np.nan)
            places[at] = own.means[:, :2]
            ids = np.full(len(columns) + 1, -1)  # the last one is for nobody
            ids[at] = own.ids
            tracks[i] = ids[self._matchers[i].step(places, people)]
            free.append(~np.isin(own.ids, tracks[i]))
        held = np.count_nonzero(tracks >= 0, axis=0)
        present = ~np.isnan(people[:, 0])
        unheld, gaps = present & (held == 0), np.full(len(people), NO_TRACK)
        if unheld.any():
            means, covariances = (
                np.concatenate([table[each] for table, each in zip(tables, free, strict=True)])
                for tables in ([own.means for own in fleet], [own.covariances for own in fleet])
            )
            gaps[unheld] = find_gaps(people[unheld], means, covariances)
        self._found |= held > 0
        return Held(tracks, gaps, _name_states(held, self._found, working, present, gaps))


def list_reports(fleet: Sequence[Sequence[Track]]) -> list[Reports]:
    """What each UAV reports of its tracks."""
    reported = [[track for track in own if track.reported] for own in fleet]
    return [Reports(np.array([track.id for track in own], dtype=np.int64), *beliefs_of(own)) for own in reported]


@lru_cache(maxsize=1)  # because scores, events, tables and pictures of one mission ask for it
def find_holding(recording: Recording) -> Held:
    """Who holds whom at each of the K scans of a recording."""
    rows = np.flatnonzero(recording.reported)
    ends = np.searchsorted(rows, recording.track_offsets)
    holding = Holding(recording.person_count, recording.uav_count, recording.setting.loss_distance)
    found = []
    for k, people in enumerate(recording.people):
        cells = range(k * recording.uav_count, (k + 1) * recording.uav_count)
        own = [rows[ends[cell] : ends[cell + 1]] for cell in cells]
        fleet = [Reports(recording.track_ids[n], recording.track_means[n], recording.track_covariances[n]) for n in own]
        found.append(holding.step(people, fleet, int(recording.working[k].sum())))
    return Held(*(np.stack(table) for table in zip(*found, strict=True)))


def find_unheld(held: Held) -> tuple[Unheld, ...]:
    """The losses of a recording, by scan, then person. Whatever counts, lists or draws losses has these spans."""
    found = []
    for person, (states, gaps) in enumerate(zip(held.states.T, held.gaps.T, strict=True)):
        since = 0
        for first, last, value in find_episodes(states):
            if HOLDS[value] not in GRADES:
                since = last + 1
                continue
            inside, outside, without = np.bincount(gaps[first : last + 1], minlength=3).tolist()
            found.append(Unheld(person, HOLDS[value], first, last, since, (without, outside, inside)))
    return tuple(sorted(found, key=lambda loss: (loss.first, loss.person)))


def find_gaps(people: Array, means: Array, covariances: Array) -> Indices:
    """Gap (M,) of each person to tracks within `FAR` m: `INSIDE` the 95 % ellipse of one, `OUTSIDE` it, or `NO_TRACK`.

    people (M, 2) m; means (A, 4) and covariances (A, 4, 4) of all UAVs' reported tracks that hold nobody.
    """
    errors = means[:, None, :2] - people
    found = np.full(len(people), NO_TRACK)
    near = length(errors) < FAR
    found[near.any(axis=0)] = OUTSIDE
    inside = squared_distance(errors, covariances[:, None, :2, :2]) <= ELLIPSE**2
    found[(near & inside).any(axis=0)] = INSIDE
    return found


def _name_states(held: Indices, found: Flags, working: int, present: Flags, gaps: Indices) -> Indices:
    """States (M,) of people, as indices into `HOLDS`, by how many UAVs hold each and whether any `found` them."""
    states = np.where(gaps == INSIDE, HOLDS.index("off the track"), HOLDS.index("lost"))
    states[~found] = HOLDS.index("not found yet")
    states[held > 0] = HOLDS.index("held by some")
    states[(held > 0) & (held == working)] = HOLDS.index("held")
    return np.where(present, states, HOLDS.index("absent"))
