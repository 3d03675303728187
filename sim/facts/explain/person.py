"""Facts about one person at one scan of a recording."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sim.facts.explain.observation import Observer, PersonObservation
from sim.facts.explain.planned_visibility import PlannedVisibility, find_planned_visibility
from sim.facts.flight import Flight
from sim.mission.recorded_links import find_recorded_links
from sim.mission.recording import Recording
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Look
from tracking.management.escapes import Escapes
from tracking.numerics.arrays import Array
from tracking.track import SIGHTED_AT, Track


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
        """A UAV's track of the person or, if it has none, the first of `holders`.

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
        return found.belief if found else holder.belief


def make_person_facts(observer: Observer, k: int, person: int) -> PersonFacts:
    """The facts about a person at scan k."""
    return PersonFacts(observer, k, person, _find_holders(observer.flight, k, person))


def _find_holders(flight: Flight, k: int, person: int) -> tuple[HoldingTrack, ...]:
    """The UAVs' tracks of the person, the one that most UAVs have first; if none does, the last that held them."""
    held = flight.people.tracks[: k + 1, :, person]
    scans = np.flatnonzero((held >= 0).any(axis=1))
    if len(scans) == 0:
        return ()
    last = int(scans[-1])
    ids, counts = np.unique(held[last][held[last] >= 0], return_counts=True)
    ids = ids[np.argsort(-counts, kind="stable")]
    return tuple(_make_holder(flight, k, person, int(id_), last) for id_ in (ids if last == k else ids[:1]))


def _make_holder(flight: Flight, k: int, person: int, id_: int, last: int) -> HoldingTrack:
    """Facts at scan k about the track that stood for the person at scan `last`."""
    recording = flight.recording
    standing = flight.people.tracks[k] == id_
    holds = np.flatnonzero(standing[:, person]).tolist()
    first = int(np.searchsorted(recording.track_offsets, np.argmax(recording.track_ids == id_), side="right")) - 1
    found = find_track_at(recording, k, [*holds, *np.flatnonzero(recording.working[k]).tolist()], id_)
    return HoldingTrack(
        number=recording.track_numbers[id_],
        holds=tuple(holds),
        elsewhere={uav: other for uav, other in np.argwhere(standing).tolist() if other != person},
        since=float(recording.times[first // recording.uav_count]),
        belief=found.belief if found else None,
        parts=find_parts(recording, k, found.uav, id_) if found else [],
        existence=found.existence if found else math.nan,
        until=float(recording.times[last]),
    )


class TrackAt(NamedTuple):
    """A track as one UAV has it after a scan."""

    uav: int
    belief: Gaussian
    existence: float  # NaN if the tracker estimates none


def find_track_at(recording: Recording, k: int, uavs: Iterable[int], id_: int) -> TrackAt | None:
    """A track after scan k, of the first of the UAVs that has it."""
    for i in uavs:
        for track, existence in zip(recording.tracks_at(k, i), recording.existence_at(k, i).tolist(), strict=True):
            if track.id == id_:
                return TrackAt(i, track.belief, existence)
    return None


def find_parts(recording: Recording, k: int, uav: int, id_: int) -> list[Track]:
    """Where the person of a UAV's track may be after scan k: the track, split by `Escapes` if they are out of sight."""
    setting = recording.setting
    escapes, parts = Escapes(), list[Track]()
    area = (setting.area.width, setting.area.height)
    cameras = [setting.believed_camera(i) for i in range(recording.uav_count)]
    last = _find_track(recording, k, uav, id_)
    since = last[0].sighting[SIGHTED_AT] if last else np.nan
    links = find_recorded_links(recording)
    for j in range(int(np.searchsorted(recording.times, since)), k + 1):
        if not (setting.decides(j) or j == k):
            continue
        heard = links[j].find_heard(uav, takes_time=setting.network.takes_time)
        taken = np.flatnonzero(heard & recording.frames_taken[j]).tolist()
        looks = [Look(cameras[i], recording.believed_camera_at(j, i)) for i in taken] if setting.decides(j) else []
        tracks = _find_track(recording, j, uav, id_)
        parts = escapes.split(float(recording.times[j]), tracks, looks, recording.believed_at(j, uav), area)
    return parts or last


def _find_track(recording: Recording, k: int, uav: int, id_: int) -> list[Track]:
    return [track for track in recording.tracks_at(k, uav) if track.id == id_]
