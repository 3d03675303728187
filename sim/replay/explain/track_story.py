"""The story of one track in words: its birth, the measurements that fed it, why it was kept, and its end."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from sim.recording.recording import Recording
from sim.replay.event import UNMATCHED, Event
from sim.replay.explain.explanation import Group, percent_text, place_text
from sim.replay.explain.track import Feed, Origin, TrackFacts
from sim.replay.views import fleet_text

_NOTE = "{} does not tell its associations: births, hits and misses are as the built-in tracker would count them"


def track_story(facts: TrackFacts, recording: Recording, events: Sequence[Event]) -> list[Group]:
    """Groups of sentences on one track over the whole mission."""
    own = [event for event in events if event.track == facts.number]
    groups = [
        ("note", [_NOTE.format(facts.foreign)] if facts.foreign else []),
        (f"track {facts.number}", [f"{event.when}: {event.text}" for event in own]),
        ("born", list(_birth(facts, recording))),
        ("fed by", list(_fed(facts, recording))),
        ("kept", list(_kept(facts, recording, own))),
        ("ended", list(_end(facts, recording))),
    ]
    return [group for group in groups if group[1]]


def _birth(facts: TrackFacts, recording: Recording) -> Iterator[str]:
    times, first = recording.times, facts.scans[0]
    if facts.known:
        yield "known at the start"
        return
    if not facts.origins:
        yield f"confirmed at {times[first]:.1f} s by {fleet_text(facts.makers)}, with no measurement near it then"
        return
    begun, *others = facts.origins
    yield f"at {times[begun.k]:.1f} s from {_source(begun, recording)}, measured by UAV {begun.uav}"
    if facts.rival:
        gate, told = math.sqrt(facts.parameters.measurement_gate), f"{facts.rival.sigmas:.1f} σ from it"
        if not facts.foreign:
            told += ", inside its gate" if facts.rival.gated else f", outside its gate of {gate:.1f} σ"
        away = f"{facts.rival.away:.1f} m from person {begun.person}"
        yield f"track {facts.rival.number}, then {away}, was {told}"
    for origin in others:
        yield f"then from {_source(origin, recording)} at {times[origin.k]:.1f} s"
    yield f"confirmed at {times[first]:.1f} s by {fleet_text(facts.makers)}"


def _source(origin: Origin, recording: Recording) -> str:
    if origin.person < 0:
        return f"a false alarm at {place_text(origin.place)}"
    off = math.dist(origin.place, recording.people[origin.k, origin.person])
    return f"a measurement of person {origin.person} at {place_text(origin.place)}, an error of {off:.2f} m"


def _fed(facts: TrackFacts, recording: Recording) -> Iterator[str]:
    """Sources of measurements, the most frequent first."""
    sources: defaultdict[tuple[int, int], list[Feed]] = defaultdict(list)
    for feed in facts.feeds:
        sources[feed.person, feed.uav].append(feed)
    for (person, uav), feeds in sorted(sources.items(), key=lambda item: -len(item[1])):
        what = f"measurements of person {person}" if person >= 0 else "false alarms"
        first, last = (f"{recording.times[feed.k]:.1f}" for feed in (feeds[0], feeds[-1]))
        when = f"at {first} s" if first == last else f"{first} to {last} s"
        weight = percent_text(float(np.mean([feed.weight for feed in feeds])))
        yield f"{what} from UAV {uav}: {_frames(len(feeds))}, {when}, weight {weight} in the mean"
    if not sources:
        yield "no measurement once it was confirmed"


def _kept(facts: TrackFacts, recording: Recording, own: Sequence[Event]) -> Iterator[str]:
    """For each span in which the track stood for no person, what told for it and against it."""
    p = facts.parameters
    for event in own:
        if event.kind not in UNMATCHED:
            continue
        looks = [look for look in facts.looks if event.first <= look.k <= event.last]
        fed = sum(look.weight >= p.seen for look in looks)
        missed = sum(look.visible >= p.expected and look.weight < p.seen for look in looks)
        told = f"detected in {fed} of {_frames(len(looks))}, missed in {missed} that should have shown it"
        first, last = (_at_scan(recording, k, facts.number)[1] for k in (event.first, event.last))
        known = "" if math.isnan(first) else f"; existence {first:.4f} at first, {last:.4f} at last"
        yield f"{event.when}: {told}{known}"
    if facts.feeds:
        feed = facts.feeds[-1]
        source = f"of person {feed.person}" if feed.person >= 0 else "of a false alarm"
        yield f"last detection at {recording.times[feed.k]:.1f} s by UAV {feed.uav}, {source}"


def _end(facts: TrackFacts, recording: Recording) -> Iterator[str]:
    last, times, p = facts.scans[1], recording.times, facts.parameters
    if last == len(times) - 1:
        yield "still there at the end of the mission"
        return
    uav, existence = _at_scan(recording, last, facts.number)
    tracks = {recording.track_numbers[t.id]: t.belief for t in recording.tracks_at(last, uav)}
    own = tracks.pop(facts.number)
    yield f"deleted at {times[last + 1]:.1f} s"
    if not facts.foreign:
        if math.isnan(existence):
            yield f"a track ends after {p.delete[0]} misses in {p.delete[1]} scans that should have shown it"
        else:
            yield f"existence {existence:.4f} before; a track ends below {p.doubt:g}"
        yield f"variance {np.trace(own.covariance[:2, :2]):.1f} m² before; a track ends beyond {p.max_variance:g} m²"
    gaps = {number: math.dist(other.mean[:2], own.mean[:2]) for number, other in tracks.items()}
    if gaps:
        near = min(gaps, key=lambda number: gaps[number])
        yield f"track {near} was the nearest, {gaps[near]:.1f} m away"


def _at_scan(recording: Recording, k: int, number: int) -> tuple[int, float]:
    """The first UAV that has a track after scan k, and its existence; NaN if that is not estimated."""
    for i in range(recording.poses.shape[1]):
        mine = recording.numbers_of(recording.track_ids_at(k, i)) == number
        if mine.any():
            return i, float(recording.existence_at(k, i)[mine][0])
    raise AssertionError("no UAV has the track")


def _frames(count: int) -> str:
    return f"{count} frame{'s' * (count != 1)}"
