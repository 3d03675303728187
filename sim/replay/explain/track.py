"""Facts of one track over a whole recording: its birth, the measurements that fed it, and its last scans."""

import math
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from sim.evaluation.score import FAR
from sim.mission.snapshot import Bools
from sim.mission.tracker_setup import tracker_parameters
from sim.replay.explain.association import Association
from sim.replay.explain.observation import Observer
from tracking.fusion.labels import LABELS_PER_SCAN, new_label
from tracking.fusion.member import TRACKERS
from tracking.management.initiation import PATIENCE
from tracking.numerics.arrays import Array
from tracking.numerics.distances import squared_distance


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


class TrackFacts:
    """One track of a recording."""

    def __init__(self, observer: Observer, number: int) -> None:
        """Facts of the track of that number; the observer has to stay open."""
        self._observer, self._recording, self._scenario = observer, observer.recording, observer.scenario
        recording, self.number = self._recording, number
        self._id = list(recording.track_numbers)[number]
        self.parameters = tracker_parameters(self._scenario)
        name = self._scenario.tracking.tracker
        # The name of a tracker from outside, of which recordings tell no associations, births and limits.
        self.foreign = "" if name in TRACKERS.built_in else name
        scans, _ = recording.cells(recording.track_offsets)
        own = scans[recording.track_ids == self._id]
        first, last = int(own[0]), int(own[-1])
        self.scans = (first, last)  # the first and the last at which any UAV had it
        self.known = first == 0 and self._scenario.tracking.initial_tracks == "known"  # given at the start
        uavs = range(recording.poses.shape[1])
        holders = tuple(i for i in uavs if self._id in recording.track_ids_at(first, i))
        confirmed = tuple(i for i in holders if 0 <= self._id - new_label(first + 1, i, 0) < LABELS_PER_SCAN // 2)
        # UAVs that had it first; the one that confirmed it, if its label tells.
        self.makers = confirmed or holders

    @cached_property
    def _frames(self) -> list[tuple[Look, Array]]:
        """The frames of UAVs that had the track before them, with the weight of each of its measurements."""
        found = []
        for k, i in product(range(self.scans[0], self.scans[1] + 1), range(self._recording.poses.shape[1])):
            a = Association.of(self._recording, self._scenario, k, i)
            if a is not None and self._id in a.ids:
                t = a.ids.tolist().index(self._id)
                found.append((Look(k, i, float(1.0 - a.missed[t]), float(a.before.visible[t])), a.beta[t, 1:]))
        return found

    @property
    def looks(self) -> list[Look]:
        """The frames as the track expected them."""
        return [look for look, _ in self._frames]

    @cached_property
    def feeds(self) -> list[Feed]:
        """The measurements that count as detections of its person."""
        seen = self.parameters.seen
        return [
            Feed(look.k, look.uav, int(self._observer.owners(look.k, look.uav)[j]), float(weights[j]))
            for look, weights in self._frames
            if look.weight >= seen
            for j in np.flatnonzero(weights >= seen).tolist()
        ]

    @cached_property
    def origins(self) -> list[Origin]:
        """The measurements of the UAV that confirmed the track, back from its first scan: each in reach of the next.

        A person may have gone anywhere up to the largest speed between two. Those that another track explains are left
        out. They end where they suffice to confirm a track, or where there is none for a second. Of a track that was
        known at the start, none.
        """
        return [] if self.known else max(map(self._chain, self.makers), key=len)

    def _chain(self, uav: int) -> list[Origin]:
        recording, p, begun = self._recording, self.parameters, self.scans[0]
        (track,) = (t for t in recording.tracks_at(begun, uav) if t.id == self._id)
        place, spread, now = track.belief.mean[:2], track.belief.covariance[:2, :2], begun
        found: list[Origin] = []
        odds = p.birth_density / p.clutter_density  # of a person against false alarms
        for k in range(begun, -1, -1):
            away = float(recording.times[now] - recording.times[k])
            apart = away > PATIENCE + p.motion.dt + 1e-6
            if apart or self._enough(len(found), odds) or (k < begun and not found):
                break
            scan = recording.scan_at(k, uav)
            S = scan.covariances + spread + np.eye(2) * (p.max_speed * away / 2) ** 2
            off = np.where(self._explained(k, uav), np.inf, squared_distance(scan.measurements - place, S))
            if off.min(initial=np.inf) <= p.measurement_gate:
                j = int(off.argmin())
                likelihood = math.exp(-off[j] / 2) / (2 * math.pi * math.sqrt(np.linalg.det(S[j])))
                odds *= p.detection_probability * likelihood / p.clutter_density if found else 1.0
                place, spread, now = scan.measurements[j], scan.covariances[j], k
                found.append(Origin(k, uav, j, int(self._observer.owners(k, uav)[j]), place))
        return found[::-1]

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

    @cached_property
    def rival(self) -> Rival | None:
        """The track that was nearest to the person whose measurement began this one; None beyond `FAR` m."""
        if not self.origins:
            return None
        origin = self.origins[0]
        a = Association.of(self._recording, self._scenario, origin.k, origin.uav)
        if a is None or origin.person < 0 or len(a.ids) == 0:
            return None
        gaps = np.hypot(*(a.before.means[:, :2] - self._recording.people[origin.k, origin.person]).T)
        t, j = int(gaps.argmin()), origin.measurement
        near = Rival(int(a.numbers[t]), float(gaps[t]), float(np.sqrt(a.distances[t, j])), bool(a.gated[t, j]))
        return near if near.away <= FAR else None
