"""Facts of one track over a whole recording: its birth, the measurements that fed it, and its last scans."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sim.evaluation.score import FAR
from sim.mission.snapshot import Bools
from sim.mission.tracker_setup import tracker_parameters
from sim.recording.recording import Recording
from sim.replay.explain.association import Association
from sim.replay.explain.observation import Observer
from sim.scenario.scenario import Scenario
from tracking.fusion.labels import LABELS_PER_SCAN, new_label
from tracking.fusion.member import TRACKERS
from tracking.management.initiation import PATIENCE
from tracking.numerics.arrays import Array
from tracking.numerics.distances import squared_distance
from tracking.parameters import TrackerParameters


class Origin(NamedTuple):
    """A measurement that a track was made of before it was recorded."""

    k: int
    uav: int
    measurement: int
    person: int  # -1 for a false alarm
    place: Array  # (2,) m


class Rival(NamedTuple):
    """A track that did not explain the first measurement of a new one, although it was nearest to the person."""

    number: int
    away: float  # m from the person
    sigmas: float  # from the measurement to where the track was foreseen
    gated: bool


class Look(NamedTuple):
    """A frame of one UAV, as the track expected it."""

    k: int
    uav: int
    weight: float  # probability that one of the measurements is of the track's person
    visible: float  # probability of plain view


class Feed(NamedTuple):
    """A measurement that counts as a detection of the track's person."""

    k: int
    uav: int
    person: int  # -1 for a false alarm
    weight: float


@dataclass(frozen=True, eq=False)
class TrackFacts:
    """One track of a recording."""

    number: int
    scans: tuple[int, int]  # the first and the last at which any UAV had it
    known: bool  # given to the trackers at the start
    makers: tuple[int, ...]  # UAVs that had it first; the one that confirmed it, if its label tells
    origins: tuple[Origin, ...]  # by time; none if they cannot be told
    rival: Rival | None
    looks: tuple[Look, ...]
    feeds: tuple[Feed, ...]
    parameters: TrackerParameters
    foreign: str  # the name of a tracker from outside, of which recordings tell no associations, births and limits

    @staticmethod
    def of(observer: Observer, number: int) -> "TrackFacts":
        """Facts of the track of that number."""
        recording, scenario = observer.recording, observer.scenario
        life = _Life(recording, scenario, list(recording.track_numbers)[number])
        known = life.first == 0 and scenario.tracking.initial_tracks == "known"
        origins = () if known else life.origins(observer)
        seen = life.parameters.seen
        feeds = (
            Feed(look.k, look.uav, int(observer.owners(look.k, look.uav)[j]), float(weights[j]))
            for look, weights in life.looks
            if look.weight >= seen
            for j in np.flatnonzero(weights >= seen).tolist()
        )
        return TrackFacts(
            number=number,
            scans=(life.first, life.last),
            known=known,
            makers=life.makers,
            origins=origins,
            rival=life.rival(origins[0]) if origins else None,
            looks=tuple(look for look, _ in life.looks),
            feeds=tuple(feeds),
            parameters=life.parameters,
            foreign="" if scenario.tracking.tracker in TRACKERS.built_in else scenario.tracking.tracker,
        )


class _Life:
    """A track in its recording."""

    def __init__(self, recording: Recording, scenario: Scenario, id_: int) -> None:
        self._recording, self._scenario, self._id = recording, scenario, id_
        self.parameters = tracker_parameters(scenario)
        scans, _ = recording.cells(recording.track_offsets)
        own = scans[recording.track_ids == id_]
        self.first, self.last = int(own[0]), int(own[-1])
        uavs = range(recording.poses.shape[1])
        holders = tuple(i for i in uavs if id_ in recording.track_ids_at(self.first, i))
        confirmed = tuple(i for i in holders if 0 <= id_ - new_label(self.first + 1, i, 0) < LABELS_PER_SCAN // 2)
        self.makers = confirmed or holders

    @cached_property
    def looks(self) -> list[tuple[Look, Array]]:
        """The frames of UAVs that had the track before them, with the weight of each of its measurements."""
        return list(self._looks())

    def _looks(self) -> Iterator[tuple[Look, Array]]:
        for k in range(self.first, self.last + 1):
            for i in range(self._recording.poses.shape[1]):
                a = Association.of(self._recording, self._scenario, k, i)
                if a is not None and self._id in a.ids:
                    t = a.ids.tolist().index(self._id)
                    yield Look(k, i, float(1.0 - a.missed[t]), float(a.before.visible[t])), a.beta[t, 1:]

    def origins(self, observer: Observer) -> tuple[Origin, ...]:
        """The measurements of the UAV that confirmed the track, back from its first scan: each in reach of the next.

        A person may have gone anywhere up to the largest speed between two. Those that another track explains are left
        out. They end where they suffice to confirm a track, or where there is none for a second.
        """
        return max((self._chain(observer, uav) for uav in self.makers), key=len)

    def _chain(self, observer: Observer, uav: int) -> tuple[Origin, ...]:
        recording, p = self._recording, self.parameters
        (track,) = (t for t in recording.tracks_at(self.first, uav) if t.id == self._id)
        place, spread, now = track.belief.mean[:2], track.belief.covariance[:2, :2], self.first
        found: list[Origin] = []
        odds = p.birth_density / p.clutter_density  # of a person against false alarms
        for k in range(self.first, -1, -1):
            away = float(recording.times[now] - recording.times[k])
            apart = away > PATIENCE + p.motion.dt + 1e-6
            if apart or self._enough(len(found), odds) or (k < self.first and not found):
                break
            scan = recording.scan_at(k, uav)
            S = scan.covariances + spread + np.eye(2) * (p.max_speed * away / 2) ** 2
            off = np.where(self._explained(k, uav), np.inf, squared_distance(scan.measurements - place, S))
            if off.min(initial=np.inf) <= p.measurement_gate:
                j = int(off.argmin())
                likelihood = math.exp(-off[j] / 2) / (2 * math.pi * math.sqrt(np.linalg.det(S[j])))
                odds *= p.detection_probability * likelihood / p.clutter_density if found else 1.0
                place, spread, now = scan.measurements[j], scan.covariances[j], k
                found.append(Origin(k, uav, j, int(observer.owners(k, uav)[j]), place))
        return tuple(reversed(found))

    def _enough(self, count: int, odds: float) -> bool:
        """True if so many measurements with these odds confirm a track."""
        p = self.parameters
        return count >= p.confirm[0] if p.life == "m_of_n" else count > 1 and odds >= p.sure / (1.0 - p.sure)

    def _explained(self, k: int, uav: int) -> Bools:
        """Flags (N,) of the measurements that are rather another track's, one that is new perhaps, than of no track."""
        a, scan = Association.of(self._recording, self._scenario, k, uav), self._recording.scan_at(k, uav)
        found = np.zeros(len(scan.measurements), dtype=np.bool_)
        if a is None:
            return found
        found |= a.beta[a.ids != self._id, 1:].max(axis=0, initial=0.0) >= 0.5
        for track in self._recording.tracks_at(k, uav):
            if track.id not in a.ids and track.id != self._id:
                off, spread = scan.measurements - track.belief.mean[:2], track.belief.covariance[:2, :2]
                found |= squared_distance(off, scan.covariances + spread) <= self.parameters.measurement_gate
        return found

    def rival(self, origin: Origin) -> Rival | None:
        """The track that was nearest to a person when the person's measurement began another; None beyond `FAR` m."""
        a = Association.of(self._recording, self._scenario, origin.k, origin.uav)
        if a is None or origin.person < 0 or len(a.ids) == 0:
            return None
        gaps = np.hypot(*(a.before.means[:, :2] - self._recording.people[origin.k, origin.person]).T)
        t, j = int(gaps.argmin()), origin.measurement
        near = Rival(int(a.numbers[t]), float(gaps[t]), float(np.sqrt(a.distances[t, j])), bool(a.gated[t, j]))
        return near if near.away <= FAR else None
