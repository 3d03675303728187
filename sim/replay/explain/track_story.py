"""The story of one track over a whole mission: its birth, its measurements, why it was kept, and its end."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from sim.drawing.lettering import Group
from sim.evaluation.score import FAR
from sim.mission.tracker_setup import tracker_parameters
from sim.replay.event import UNMATCHED, Event, ends
from sim.replay.explain.explanation import percent_text, place_text, source_text
from sim.replay.explain.observation import Observer
from sim.replay.explain.person import track_at
from sim.replay.history import fleet_text
from tracking.filter.kalman import Gaussian
from tracking.fusion.labels import LABELS_PER_SCAN, new_label
from tracking.management.initiation import PATIENCE
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.distances import squared_distance
from tracking.parameters import EXPECTED, SEEN


class Origin(NamedTuple):
    """A measurement from which a track was initiated, before it was confirmed and recorded."""

    k: int
    uav: int
    measurement: int
    person: int  # -1 for a false alarm
    place: Array  # (2,) m


class TrackObservation(NamedTuple):
    """A frame of one UAV with its data association to the track."""

    k: int
    uav: int
    weights: Array  # (N,), probability of each measurement to be the track's person's
    weight: float  # probability that any of them is
    visible: float  # probability of plain view


class TrackDetection(NamedTuple):
    """A measurement that counts as a detection of the track's person."""

    k: int
    uav: int
    person: int  # -1 for a false alarm
    weight: float


class TrackFacts:
    """One track of a recording."""

    def __init__(self, observer: Observer, number: int) -> None:
        """Facts about the track with this number; the observer has to stay open."""
        self.observer, self.recording, self.number = observer, observer.recording, number
        recording = observer.recording
        self.id = list(recording.track_numbers)[number]
        self.parameters = tracker_parameters(recording.setting)
        scans, _ = recording.cells(recording.track_offsets)
        own = scans[recording.track_ids == self.id]
        first, last = int(own[0]), int(own[-1])
        self.scans = (first, last)  # first and last scan at which any UAV had the track
        self.known = first == 0 and recording.setting.tracking.initial_tracks == "known"  # given at the start
        holders = self.holders(first)
        confirmed = tuple(i for i in holders if 0 <= self.id - new_label(first + 1, i, 0) < LABELS_PER_SCAN // 2)
        # The UAV that confirmed the track, by its label, or else the UAVs that had it first.
        self.makers = confirmed or holders

    def holders(self, k: int) -> tuple[int, ...]:
        """The UAVs that have the track after scan k."""
        uavs = range(self.recording.poses.shape[1])
        return tuple(i for i in uavs if self.id in self.recording.track_ids_at(k, i))

    def held_at(self, k: int) -> tuple[int, Gaussian, float]:
        """The first UAV that has the track after scan k, its belief, and its existence (NaN if not estimated)."""
        found = track_at(self.recording, k, range(self.recording.poses.shape[1]), self.id)
        assert found is not None
        return found

    @cached_property
    def observations(self) -> list[TrackObservation]:
        """The frames of UAVs that had the track before the frame."""
        found = []
        for k, i in product(range(self.scans[0], self.scans[1] + 1), range(self.recording.poses.shape[1])):
            a = self.observer.association(k, i)
            if a is not None and self.id in a.ids:
                t = a.ids.tolist().index(self.id)
                beta, visible = a.beta[t], float(a.before.visible[t])
                found.append(TrackObservation(k, i, beta[1:], float(1.0 - beta[0]), visible))
        return found

    @cached_property
    def detections(self) -> list[TrackDetection]:
        """The measurements that count as detections of the track's person."""
        return [
            TrackDetection(o.k, o.uav, int(self.observer.owners(o.k, o.uav)[j]), float(o.weights[j]))
            for o in self.observations
            for j in np.flatnonzero(o.weights >= SEEN).tolist()
        ]

    @cached_property
    def origins(self) -> list[Origin]:
        """Measurements of the UAV that confirmed the track, from its first scan backwards, each in reach of the next.

        In reach is any place to which a person can have moved in the meantime, at up to the largest speed. Measurements
        that another track explains are left out. The chain ends once it suffices to confirm a track, or if there is no
        measurement for a second. It is empty for a track that was known at the start.
        """
        return [] if self.known else max(map(self._chain, self.makers), key=len)

    def _chain(self, uav: int) -> list[Origin]:
        recording, p, begun = self.recording, self.parameters, self.scans[0]
        (track,) = (t for t in recording.tracks_at(begun, uav) if t.id == self.id)
        place, spread, now = track.belief.mean[:2], track.belief.covariance[:2, :2], begun
        found: list[Origin] = []
        odds = p.birth_density / p.clutter_density  # odds of a person against a false alarm
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
                found.append(Origin(k, uav, j, int(self.observer.owners(k, uav)[j]), place))
        return found[::-1]

    def _enough(self, count: int, odds: float) -> bool:
        """True if so many measurements with these odds confirm a track."""
        p = self.parameters
        if p.management == "m_of_n":
            return count >= p.confirm[0]
        return count > 1 and odds >= p.confirmation_threshold / (1.0 - p.confirmation_threshold)

    def _explained(self, k: int, uav: int) -> Flags:
        """Mask (N,) of the measurements that probably belong to another track, such as a new one."""
        a, scan = self.observer.association(k, uav), self.recording.scan_at(k, uav)
        found = np.zeros(len(scan.measurements), dtype=np.bool_)
        if a is None:
            return found
        found |= a.beta[a.ids != self.id, 1:].max(axis=0, initial=0.0) >= 0.5
        for track in self.recording.tracks_at(k, uav):
            if track.id not in a.ids and track.id != self.id:
                off, spread = scan.measurements - track.belief.mean[:2], track.belief.covariance[:2, :2]
                found |= squared_distance(off, scan.covariances + spread) <= self.parameters.measurement_gate
        return found


def track_story(facts: TrackFacts) -> list[Group]:
    """Groups of sentences about one track over the whole mission."""
    own = [event for event in facts.observer.flight.events if event.track == facts.number]
    groups = [
        ("note", list(filter(None, [facts.observer.note]))),
        (f"track {facts.number}", [f"{event.when}: {event.text}" for event in own]),
        ("born", list(_birth(facts))),
        ("fed by", list(_fed(facts))),
        ("kept", list(_kept(facts, own))),
        ("ended", list(_end(facts))),
    ]
    return [group for group in groups if group[1]]


def _birth(facts: TrackFacts) -> Iterator[str]:
    times, first = facts.recording.times, facts.scans[0]
    if facts.known:
        yield "known at the start"
        return
    if not facts.origins:
        yield f"confirmed at {times[first]:.1f} s by {fleet_text(facts.makers)}, with no measurement near it then"
        return
    begun, *others = facts.origins
    yield f"at {times[begun.k]:.1f} s from {_source(begun, facts)}, measured by UAV {begun.uav}"
    yield from _rival(begun, facts)
    for origin in others:
        yield f"then from {_source(origin, facts)} at {times[origin.k]:.1f} s"
    yield f"confirmed at {times[first]:.1f} s by {fleet_text(facts.makers)}"


def _rival(begun: Origin, facts: TrackFacts) -> Iterator[str]:
    """The track nearest to the person whose measurement began this one, which did not explain the measurement."""
    a = facts.observer.association(begun.k, begun.uav)
    if a is None or begun.person < 0 or len(a.ids) == 0:
        return
    gaps = np.hypot(*(a.before.means[:, :2] - facts.recording.people[begun.k, begun.person]).T)
    t, j = int(gaps.argmin()), begun.measurement
    if gaps[t] <= FAR:
        gate = f"outside its gate of {math.sqrt(facts.parameters.measurement_gate):.1f} σ"
        gated = "" if facts.observer.note else ", inside its gate" if a.gated[t, j] else f", {gate}"
        away = f"{gaps[t]:.1f} m from person {begun.person}"
        yield f"track {a.numbers[t]}, then {away}, was {math.sqrt(a.distances[t, j]):.1f} σ from it{gated}"


def _source(origin: Origin, facts: TrackFacts) -> str:
    if origin.person < 0:
        return f"a false alarm at {place_text(origin.place)}"
    off = math.dist(origin.place, facts.recording.people[origin.k, origin.person])
    return f"a measurement of person {origin.person} at {place_text(origin.place)}, an error of {off:.2f} m"


def _fed(facts: TrackFacts) -> Iterator[str]:
    """Sources of the track's measurements, the most frequent first."""
    sources: defaultdict[tuple[int, int], list[TrackDetection]] = defaultdict(list)
    for detection in facts.detections:
        sources[detection.person, detection.uav].append(detection)
    for (person, uav), detections in sorted(sources.items(), key=lambda item: -len(item[1])):
        what = f"measurements of person {person}" if person >= 0 else "false alarms"
        first, last = (f"{facts.recording.times[detection.k]:.1f}" for detection in (detections[0], detections[-1]))
        when = f"at {first} s" if first == last else f"{first} to {last} s"
        weight = percent_text(float(np.mean([detection.weight for detection in detections])))
        yield f"{what} from UAV {uav}: {_frames(len(detections))}, {when}, weight {weight} in the mean"
    if not sources:
        yield "no measurement once it was confirmed"


def _kept(facts: TrackFacts, own: Sequence[Event]) -> Iterator[str]:
    """Evidence for and against the track while it stood for no person, and times when it was not reported."""
    for event in own:
        if event.kind not in UNMATCHED:
            continue
        observations = [o for o in facts.observations if event.first <= o.k <= event.last]
        detected = sum(o.weight >= SEEN for o in observations)
        missed = sum(o.visible >= EXPECTED and o.weight < SEEN for o in observations)
        counts = f"detected in {detected} of {_frames(len(observations))}, missed in {missed} that should have shown it"
        first, last = (facts.held_at(k)[2] for k in (event.first, event.last))
        known = "" if math.isnan(first) else f"; existence {first:.4f} at first, {last:.4f} at last"
        yield f"{event.when}: {counts}{known}"
    scans, _ = facts.recording.cells(facts.recording.track_offsets)
    rows = facts.recording.track_ids == facts.id
    without = np.setdiff1d(scans[rows], scans[rows & facts.recording.reported])
    if len(without):
        first, last = ends(facts.recording.times, *without[[0, -1]])
        yield f"not reported in {len(without)} scans, {first:.1f} to {last:.1f} s: existence of one half or less"
    if facts.detections:
        detection = facts.detections[-1]
        when = f"at {facts.recording.times[detection.k]:.1f} s by UAV {detection.uav}"
        yield f"last detection {when}, {source_text(detection.person)}"


def _end(facts: TrackFacts) -> Iterator[str]:
    last, recording, p = facts.scans[1], facts.recording, facts.parameters
    times = recording.times
    if last == len(times) - 1:
        yield "still there at the end of the mission"
        return
    uav, own, existence = facts.held_at(last)
    holders = facts.holders(last)
    if not recording.working[last + 1, holders].any():
        yield f"ended at {times[last + 1]:.1f} s, as {fleet_text(holders)} broke down"
        return
    yield f"deleted at {times[last + 1]:.1f} s"
    if not facts.observer.note:
        if math.isnan(existence):
            yield f"a track ends after {p.delete[0]} misses in {p.delete[1]} scans that should have shown it"
        else:
            yield f"existence {existence:.4f} before; a track is deleted below {p.deletion_threshold:g}"
        variance = np.trace(own.covariance[:2, :2])
        yield f"variance {variance:.1f} m² before; a track is deleted beyond {p.max_variance:g} m²"
    others = [t for t in recording.tracks_at(last, uav) if t.id != facts.id]
    gaps = [(math.dist(t.belief.mean[:2], own.mean[:2]), recording.track_numbers[t.id]) for t in others]
    if gaps:
        gap, near = min(gaps)
        yield f"track {near} was the nearest, {gap:.1f} m away"


def _frames(count: int) -> str:
    return f"{count} frame{'s' * (count != 1)}"
