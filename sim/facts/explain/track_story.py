"""The story of one track over a whole mission: its birth, its measurements, why it was kept, and its deletion."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from sim.facts.event import UNMATCHED, Event, find_ends, format_times
from sim.facts.explain.observation import Observer
from sim.facts.explain.person import find_track_at
from sim.facts.metrics.holding import FAR
from sim.facts.sightings import tell_fade
from sim.facts.words import TextGroup, format_percent, format_place, name_fleet, name_source
from sim.mission.tracker_setup import make_tracker_parameters
from tracking.account import Deletion, Origin
from tracking.errors import spell
from tracking.filter.kalman import Gaussian
from tracking.numerics.arrays import Array
from tracking.parameters import EXPECTED, SEEN


class TrackObservation(NamedTuple):
    """A frame of one UAV with its data association to the track."""

    k: int
    uav: int
    weights: Array  # (N,), probability of each measurement to be the track's person's
    weight: float  # probability that any of them is
    visible: float  # probability of plain view


class TrackMeasurement(NamedTuple):
    """A measurement from which a track was initiated, or which counts as a detection of its person."""

    k: int
    uav: int
    measurement: int
    person: int  # -1 for a false alarm
    place: Array  # (2,) m


class TrackFacts:
    """One track of a recording, with the account of its trackers."""

    def __init__(self, observer: Observer, number: int) -> None:
        """Facts about the track with this number; the observer has to stay open."""
        self.observer, self.recording, self.number = observer, observer.recording, number
        recording = observer.recording
        self.id = list(recording.track_numbers)[number]
        scans, _ = recording.cells(recording.track_offsets)
        own = scans[recording.track_ids == self.id]
        self.first, self.last = int(own[0]), int(own[-1])  # scans at which any UAV had the track
        self.known = self.first == 0 and recording.setting.tracking.initial_tracks == "known"  # given at the start

    def holders(self, k: int) -> tuple[int, ...]:
        """The UAVs that have the track after scan k."""
        uavs = range(self.recording.uav_count)
        return tuple(i for i in uavs if self.id in self.recording.track_ids_at(k, i))

    def held_at(self, k: int) -> tuple[int, Gaussian, float]:
        """The first UAV that has the track after scan k, its belief, and its existence (NaN if not estimated)."""
        found = find_track_at(self.recording, k, range(self.recording.uav_count), self.id)
        assert found is not None
        return found

    @cached_property
    def observations(self) -> list[TrackObservation]:
        """The frames of UAVs that had the track before the frame."""
        found = []
        for k, i in product(range(self.first, self.last + 1), range(self.recording.uav_count)):
            a = self.observer.replay.association(k, i)
            if a is not None and self.id in a.ids:
                t = a.ids.tolist().index(self.id)
                weight, visible = float(1.0 - a.after.missed[t]), float(a.before.visible[t])
                found.append(TrackObservation(k, i, a.weights()[t], weight, visible))
        return found

    @cached_property
    def detections(self) -> list[tuple[TrackMeasurement, float]]:
        """The measurements that count as detections of the track's person, with their weights."""
        return [
            (self._measurement(o.k, o.uav, j), float(o.weights[j]))
            for o in self.observations
            for j in np.flatnonzero(o.weights >= SEEN).tolist()
        ]

    def births(self, k: int, id_: int) -> list[list[TrackMeasurement]]:
        """For each UAV that confirmed a track with this id at scan k, the measurements that initiated the track."""
        return [
            [self._origin(i, origin) for origin in birth.origins]
            for i, account in self.observer.replay.accounts_at(k)
            for birth in account.births
            if birth.id == id_
        ]

    def _origin(self, uav: int, origin: Origin) -> TrackMeasurement:
        k = int(np.abs(self.recording.times - origin.time).argmin())
        places = self.recording.scan_at(k, uav).measurements
        return self._measurement(k, uav, int((places == origin.place).all(axis=1).argmax()))

    def _measurement(self, k: int, uav: int, j: int) -> TrackMeasurement:
        place, owner = self.recording.scan_at(k, uav).measurements[j], self.observer.owners(k, uav)[j]
        return TrackMeasurement(k, uav, j, int(owner), place)


def tell_track_story(facts: TrackFacts) -> list[TextGroup]:
    """Groups of sentences about one track over the whole mission."""
    own = [event for event in facts.observer.flight.events if event.track == facts.number]
    groups = [
        TextGroup("note", list(filter(None, [facts.observer.replay.note]))),
        TextGroup(f"track {facts.number}", [f"{event.when}: {event.text}" for event in own]),
        TextGroup("born", list(_tell_birth(facts))),
        TextGroup("fed by", list(_tell_fed(facts))),
        TextGroup("kept", list(_tell_kept(facts, own))),
        TextGroup("deleted", list(_tell_deletion(facts))),
    ]
    return [group for group in groups if group.sentences]


def _tell_birth(facts: TrackFacts) -> Iterator[str]:
    when = f"{facts.recording.times[facts.first]:.1f} s"
    if facts.known:
        yield "known at the start"
        return
    births = facts.births(facts.first, facts.id)
    for begun, *others in births:
        source = _name_source(begun, facts)
        yield f"at {facts.recording.times[begun.k]:.1f} s from {source}, measured by UAV {begun.uav}"
        yield from _tell_rival(begun, facts)
        for measured in others:
            yield f"then from {_name_source(measured, facts)} at {facts.recording.times[measured.k]:.1f} s"
        yield f"confirmed at {when} by UAV {begun.uav}"
    if not births:
        yield f"first held at {when} by {name_fleet(facts.holders(facts.first))}"


def _tell_rival(begun: TrackMeasurement, facts: TrackFacts) -> Iterator[str]:
    """The track nearest to the person whose measurement began this one, which did not explain the measurement."""
    a = facts.observer.replay.association(begun.k, begun.uav)
    if a is None or begun.person < 0 or len(a.ids) == 0:
        return
    gaps = np.hypot(*(a.before.means[:, :2] - facts.recording.people[begun.k, begun.person]).T)
    t, j = int(gaps.argmin()), begun.measurement
    if gaps[t] <= FAR:
        number = facts.recording.numbers_of(a.ids)[t]
        gate = math.sqrt(make_tracker_parameters(facts.recording.setting).measurement_gate)
        gated = "inside its gate" if a.gated()[t, j] else f"outside its gate of {gate:.1f} σ"
        away = f"{gaps[t]:.1f} m from person {begun.person}"
        yield f"track {number}, then {away}, was {math.sqrt(a.distances()[t, j]):.1f} σ from it, {gated}"


def _name_source(measured: TrackMeasurement, facts: TrackFacts) -> str:
    if measured.person < 0 and not facts.recording.labelled:
        return f"a measurement at {format_place(measured.place)}"
    if measured.person < 0:
        return f"a false alarm at {format_place(measured.place)}"
    off = math.dist(measured.place, facts.recording.people[measured.k, measured.person])
    return f"a measurement of person {measured.person} at {format_place(measured.place)}, an error of {off:.2f} m"


def _tell_fed(facts: TrackFacts) -> Iterator[str]:
    """Sources of the track's measurements, the most frequent first."""
    sources: defaultdict[tuple[int, int], list[tuple[int, float]]] = defaultdict(list)
    for detection, weight in facts.detections:
        sources[detection.person, detection.uav].append((detection.k, weight))
    for (person, uav), found in sorted(sources.items(), key=lambda item: -len(item[1])):
        alarms = "false alarms" if facts.recording.labelled else "measurements"
        what = f"measurements of person {person}" if person >= 0 else alarms
        when = format_times(facts.recording.times[found[0][0]], facts.recording.times[found[-1][0]])
        mean = format_percent(float(np.mean([weight for _, weight in found])))
        yield f"{what} from UAV {uav}: {_format_frames(len(found))}, {when}, weight {mean} in the mean"
    if not sources and not facts.observer.replay.note:
        yield "no measurement once it was confirmed"


def _tell_kept(facts: TrackFacts, own: Sequence[Event]) -> Iterator[str]:
    """Evidence for and against the track while it stood for no person, re-acquisitions, and when it was unlikely."""
    times = facts.recording.times
    for event in own if facts.observations else ():
        if event.kind not in UNMATCHED:
            continue
        observations = [o for o in facts.observations if event.first <= o.k <= event.last]
        detected = sum(o.weight >= SEEN for o in observations)
        missed = sum(o.visible >= EXPECTED and o.weight < SEEN for o in observations)
        frames = _format_frames(len(observations))
        counts = f"detected in {detected} of {frames}, missed in {missed} that should have shown it"
        first, last = (facts.held_at(k)[2] for k in (event.first, event.last))
        known = "" if math.isnan(first) else f"; existence {first:.4f} at first, {last:.4f} at last"
        yield f"{event.when}: {counts}{known}"
    yield from _tell_reacquired(facts)
    scans, _ = facts.recording.cells(facts.recording.track_offsets)
    rows = facts.recording.track_ids == facts.id
    without = np.setdiff1d(scans[rows], scans[rows & facts.recording.reported])
    if len(without):
        first, last = find_ends(times, *without[[0, -1]])
        yield f"not reported in {len(without)} scans, {first:.1f} to {last:.1f} s: existence of one half or less"
    if facts.detections:
        detection, _ = facts.detections[-1]
        source = f", {name_source(detection.person)}" * facts.recording.labelled
        yield f"last detection at {times[detection.k]:.1f} s by UAV {detection.uav}{source}"


def _tell_reacquired(facts: TrackFacts) -> Iterator[str]:
    """The measurements of the new tracks that went on with this one after it was lost."""
    times = facts.recording.times
    for k in range(facts.first, facts.last + 1):
        accounts = facts.observer.replay.accounts_at(k)
        for new in sorted({r.new_id for _, account in accounts for r in account.reacquisitions if r.id == facts.id}):
            for begun, *_ in facts.births(k, new):
                source = f"{_name_source(begun, facts)} at {times[begun.k]:.1f} s, measured by UAV {begun.uav}"
                yield f"re-acquired at {times[k]:.1f} s by a new track from {source}"


def _tell_deletion(facts: TrackFacts) -> Iterator[str]:
    recording, replay, last = facts.recording, facts.observer.replay, facts.last
    if last == len(recording.times) - 1:
        yield "not before the end of the mission"
        return
    time, holders = f"{recording.times[last + 1]:.1f} s", facts.holders(last)
    if not recording.working[last + 1, holders].any():
        yield f"at {time}, as {name_fleet(holders)} broke down"
        return
    k, uavs_by_reason = _find_deletions(facts)
    if k <= last:
        met = not uavs_by_reason and last + 1 < len(replay.states)
        yield f"at {time}{', as UAVs that met had another track of its person' if met else ''}"
    for reason, uavs in uavs_by_reason.items():
        yield f"at {recording.times[k]:.1f} s by {name_fleet(uavs)}: {reason}"
    if fade := tell_fade(recording, facts.id, last):
        yield fade
    uav, own, _ = facts.held_at(last)
    others = [t for t in recording.tracks_at(last, uav) if t.id != facts.id]
    gaps = [(math.dist(t.belief.mean[:2], own.mean[:2]), recording.track_numbers[t.id]) for t in others]
    if gaps:
        gap, near = min(gaps)
        yield f"track {near} was the nearest, {gap:.1f} m away"


def _find_deletions(facts: TrackFacts) -> tuple[int, dict[str, list[int]]]:
    """The scan of the track's last deletions, and their UAVs by reason; -1 and none if no tracker tells.

    UAVs that were out of contact may delete it later.
    """
    for k in range(facts.last + 1, facts.first - 1, -1):
        reasons: defaultdict[str, list[int]] = defaultdict(list)
        for uav, account in facts.observer.replay.accounts_at(k):
            for deletion in account.deletions:
                if deletion.id == facts.id:
                    reasons[_tell_reason(deletion, facts)].append(uav)
        if reasons:
            return k, reasons
    return -1, {}


def _tell_reason(deletion: Deletion, facts: TrackFacts) -> str:
    """The reason in words; mypy finds a `DeletionReason` that has no case."""
    p = facts.recording.setting.tracking
    match deletion.reason:
        case "merged":
            (number,) = facts.recording.numbers_of(np.array([deletion.merged_into]))
            return f"it shared its person with track {number}, which goes on"
        case "variance":
            return f"variance {deletion.variance:.1f} m²; a track is deleted beyond {p.max_variance:g} m²"
        case "unlikely":
            if p.management == "m_of_n":
                return f"{p.delete[0]} misses in {p.delete[1]} scans that should have shown its person"
            return f"existence {spell(deletion.existence, 2)}; a track is deleted below {p.deletion_threshold:g}"


def _format_frames(count: int) -> str:
    return f"{count} frame{'s' * (count != 1)}"
