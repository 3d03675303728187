"""Facts about one person at one scan of a recording."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.facts.explain.escaped import find_parts
from sim.facts.explain.observation import Observer, PersonObservation
from sim.facts.explain.planned_visibility import PlannedVisibility, find_planned_visibility
from sim.facts.flight import Flight
from sim.mission.recording import Recording
from tracking.filter.kalman import Gaussian
from tracking.numerics.arrays import Array
from tracking.track import Track


@dataclass(frozen=True, eq=False)
class HoldingTrack:
    """A track that stands for a person, or was the last to do so, in the state that one UAV has after a scan."""

    number: int  # displayed number, by first appearance
    holds: tuple[int, ...]  # UAVs for which it stands for the person now
    elsewhere: dict[int, int]  # other people for whom it stands now, by UAV
    since: float  # s, time of its first scan
    belief: Gaussian | None  # None if no UAV has the track any more
    parts: list[Track]  # as from `find_parts`; none if no UAV has the track any more
    existence: float  # existence probability; NaN if it is not estimated
    until: float  # s, time of the last scan at which it stood for the person


@dataclass(frozen=True, eq=False)
class PersonFacts:
    """Facts about one person at one scan, given n UAVs; the observer has to stay open."""

    observer: Observer
    k: int
    person: int
    # The tracks that stand for the person, that of most UAVs first. If none does, the last that did, if there is one.
    holders: tuple[HoldingTrack, ...]

    @staticmethod
    def of(observer: Observer, k: int, person: int) -> "PersonFacts":
        """The facts about a person at scan k."""
        return PersonFacts(observer, k, person, _find_holders(observer.flight, k, person))

    @property
    def flight(self) -> Flight:
        """The flight of the observer."""
        return self.observer.flight

    @property
    def place(self) -> Array:
        """Position (2,) m; NaN if absent."""
        return np.asarray(self.flight.recording.people[self.k, self.person])

    @cached_property
    def observations(self) -> list[PersonObservation]:
        """Observations of the person by each UAV."""
        return [self.observer.observe(self.k, i, self.person) for i in range(len(self.flight.scenario.uavs))]

    @cached_property
    def planned(self) -> list[PlannedVisibility | None]:
        """Visibility of the person and of the track on the plan of each UAV."""
        uavs, recording = range(len(self.flight.scenario.uavs)), self.flight.recording
        return [find_planned_visibility(recording, self.k, i, self.person, self._find_belief(i)) for i in uavs]

    def track_of(self, uav: int) -> HoldingTrack | None:
        """The track by which a UAV holds the person or, if it has none, the first of `holders`.

        None if that one stands for another person on this UAV, as ids differ between UAVs that do not hear each other.
        """
        own = next((holder for holder in self.holders if uav in holder.holds), next(iter(self.holders), None))
        return None if own is None or uav in own.elsewhere else own

    def _find_belief(self, uav: int) -> Gaussian | None:
        """The belief of the track that a UAV has after scan k; that of another UAV if it does not have the track."""
        if (holder := self.track_of(uav)) is None:
            return None
        id_ = list(self.flight.recording.track_numbers)[holder.number]
        found = find_track_at(self.flight.recording, self.k, [uav], id_)
        return found[1] if found else holder.belief


def _find_holders(flight: Flight, k: int, person: int) -> tuple[HoldingTrack, ...]:
    """The tracks by which UAVs hold the person, that of most UAVs first; if none does, the last that held them."""
    held = flight.history.tracks[: k + 1, :, person]
    scans = np.flatnonzero((held >= 0).any(axis=1))
    if len(scans) == 0:
        return ()
    last = int(scans[-1])
    ids, counts = np.unique(held[last][held[last] >= 0], return_counts=True)
    ids = ids[np.argsort(-counts, kind="stable")]
    return tuple(_make_holder(flight, k, person, int(id_), last) for id_ in (ids if last == k else ids[:1]))


def _make_holder(flight: Flight, k: int, person: int, id_: int, last: int) -> HoldingTrack:
    """Facts at scan k about the track that stood for the person at scan `last`."""
    recording, standing = flight.recording, flight.history.tracks[k] == id_
    holds = np.flatnonzero(standing[:, person]).tolist()
    first = int(np.searchsorted(recording.track_offsets, np.argmax(recording.track_ids == id_), side="right")) - 1
    found = find_track_at(recording, k, [*holds, *np.flatnonzero(recording.working[k]).tolist()], id_)
    return HoldingTrack(
        number=recording.track_numbers[id_],
        holds=tuple(holds),
        elsewhere={uav: other for uav, other in np.argwhere(standing).tolist() if other != person},
        since=float(recording.times[first // recording.uav_count]),
        belief=found[1] if found else None,
        parts=find_parts(recording, k, found[0], id_) if found else [],
        existence=found[2] if found else math.nan,
        until=float(recording.times[last]),
    )


def find_track_at(recording: Recording, k: int, uavs: Iterable[int], id_: int) -> tuple[int, Gaussian, float] | None:
    """The first of the UAVs that has a track after scan k, its belief and existence (NaN if the tracker has none)."""
    for i in uavs:
        for track, existence in zip(recording.tracks_at(k, i), recording.existence_at(k, i).tolist(), strict=True):
            if track.id == id_:
                return i, track.belief, existence
    return None
