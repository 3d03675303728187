"""Explanations in words: of one person at one scan, and over a whole mission."""

import math
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from sim.facts.event import UNHELD, UNMATCHED, Event, find_lasting_ends, list_outages_at
from sim.facts.explain.observation import PersonMeasurement, PersonObservation
from sim.facts.explain.person import HoldingTrack, PersonFacts
from sim.facts.explain.planned_visibility import HIDDEN, IN_VIEW, PlannedVisibility
from sim.facts.metrics.holding import HOLDS, find_episodes
from sim.facts.metrics.score import estimate_velocities
from sim.facts.people import PeopleFacts
from sim.facts.words import TextGroup, format_percent, format_place, name_fleet, name_source
from sim.mission.recording import Recording
from sim.scenario.remarks import describe_small_people
from tracking.account import Association
from tracking.management.escapes import TURN_TIME
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.distances import squared_distance
from tracking.track import UNLIKELY, Track

_COMPASS = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")
_LEAST = 0.005  # least probability of a measurement that gets a line


def explain_person(facts: PersonFacts) -> list[TextGroup]:
    """Sentences on one person at one scan: the person, each UAV, the tracks, events at that time, and intents."""
    groups = [TextGroup(f"person {facts.person} at {facts.flight.recording.times[facts.k]:.1f} s", _tell_person(facts))]
    if np.isnan(facts.place[0]):
        return groups
    groups.append(TextGroup("note", list(filter(None, [facts.observer.replay.note]))))
    groups += [TextGroup(f"UAV {w.uav}", _tell_observation(w, facts)) for w in facts.observations]
    groups += [TextGroup(f"track {holder.number}", _tell_track(holder, facts)) for holder in facts.holders]
    groups.append(TextGroup("events", [f"{event.when}: {event.sentence}" for event in _find_events(facts)]))
    groups.append(TextGroup("intents", _tell_intents(facts)))
    return [group for group in groups if group.sentences]


def _tell_person(facts: PersonFacts) -> list[str]:
    if np.isnan(facts.place[0]):
        return ["is not there at this time"]
    walks = ""
    vx, vy = estimate_velocities(facts.flight.recording)[facts.k, facts.person].tolist()
    if not math.isnan(vx):
        walks = f" and walks {math.hypot(vx, vy):.1f} m/s to the {_name_direction(vx, vy)}"
    return [f"is at {format_place(facts.place)}{walks}", *_tell_holding(facts), _tell_detections(facts)]


def _name_direction(east: float, north: float) -> str:
    return _COMPASS[round(math.atan2(north, east) / (math.pi / 4)) % 8]


def _tell_holding(facts: PersonFacts) -> list[str]:
    """UAVs that hold the person or, if none does, the beginning and end of the loss."""
    recording = facts.flight.recording
    times = recording.times
    held = [f"held by {name_fleet(holder.holds)} as track {holder.number}" for holder in facts.holders if holder.holds]
    if held:
        return held
    unheld = (event for event in facts.flight.events if event.kind in UNHELD and event.person == facts.person)
    within = f"within {facts.flight.scenario.loss_distance:g} m"
    loss = next(event for event in unheld if event.first <= facts.k <= event.last)
    end, what = loss.last + 1, loss.kind.removeprefix("person ")
    if end == len(times):
        later = f"not held {'again ' if facts.holders else ''}by the end of the mission"
    else:
        state = HOLDS[facts.flight.people.hold_states[end, facts.person]]
        later = f"{'held' if state.startswith('held') else state} from {times[end]:.1f} s on"
    if not facts.holders:
        return [f"{what}: no track has been {within} so far", later]
    lines = [f"{what} since {loss.time:.1f} s{_format_ago(times, loss.first, facts.k)}: no reported track {within}"]
    (last,) = facts.holders
    return [*lines, f"last held as track {last.number} at {last.until:.1f} s; {later}"]


def _tell_detections(facts: PersonFacts) -> str:
    times = facts.flight.recording.times
    seen = facts.flight.people.detected[: facts.k + 1, :, facts.person]
    scans = np.flatnonzero(seen.any(axis=1))
    if len(scans) == 0:
        return "not detected so far"
    fleet = name_fleet(np.flatnonzero(seen[scans[-1]]).tolist())
    if scans[-1] == facts.k:
        return f"detected by {fleet}"
    return f"last detected by {fleet} at {times[scans[-1]]:.1f} s{_format_ago(times, int(scans[-1]), facts.k)}"


def _format_ago(times: Array, scan: int, k: int) -> str:
    return f", {times[k] - times[scan]:.1f} s ago" if k > scan else ""


def _tell_observation(w: PersonObservation, facts: PersonFacts) -> list[str]:
    if not w.works:
        return ["has broken down"]
    lines = [] if w.sighting.looked else ["took no frame at this scan; what geometry tells:"]
    lines += _tell_view(w, facts.flight.recording)
    if w.found:
        lines.append(_tell_detection(w.found))
    if w.association:
        numbers = facts.flight.recording.numbers_of(w.association.ids).tolist()
        lines += _tell_gates(w.found.measurement, w.association, numbers) if w.found else []
        lines += _tell_association(w, w.association, numbers, facts) if facts.holders else []
    return lines


def _tell_view(w: PersonObservation, recording: Recording) -> list[str]:
    sighting = w.sighting
    lines = [f"{sighting.status}, {w.away:.1f} m from the point below the camera", *w.errors]
    for tree, share in sighting.hidden_by.items():
        trunk, radius = recording.trees[tree, :2], recording.trees[tree, 2]
        text = f"tree {tree} stands at {format_place(trunk)}, its canopy reaches {radius:.1f} m"
        part = f", and it hides {100 * share:.0f} %" if share < 1.0 and len(sighting.hidden_by) > 1 else ""
        lines.append(text + part)
    if w.whole == 0 and (small := describe_small_people(recording.setting.uavs[w.uav])):
        lines.append(f"{small} of its image")
    elif w.whole:
        share = 100 * sighting.pixels / w.whole
        lines.append(f"shows {sighting.pixels} of {w.whole} pixels that it would show if nothing hid it, {share:.0f} %")
    return lines


def _tell_detection(found: PersonMeasurement) -> str:
    at = "measured" if found.pixel is None else f"detected at pixel ({found.pixel[0]:.1f}, {found.pixel[1]:.1f})"
    return f"{at}: {format_place(found.place)}, an error of {found.error:.2f} m, {found.sigmas:.1f} σ"


def _tell_gates(measurement: int, a: Association, numbers: Sequence[int]) -> list[str]:
    """The tracks that may be associated with a measurement, the likeliest first."""
    weights, sigmas = a.weights()[:, measurement], np.sqrt(a.distances()[:, measurement])
    tracks = np.flatnonzero(a.gated()[:, measurement])
    lines = [
        f"in the gate of track {numbers[t]} at {sigmas[t]:.1f} σ, weight {format_percent(float(weights[t]))}"
        for t in tracks[np.argsort(-weights[tracks], kind="stable")]
    ]
    return lines or ["in the gate of no track"]


def _tell_association(w: PersonObservation, a: Association, numbers: Sequence[int], facts: PersonFacts) -> list[str]:
    """The scan that the person's track predicted, and other measurements that may be associated with the track."""
    lines = []
    holder = facts.track_of(w.uav)
    if holder is None:
        other = facts.holders[0]
        return [f"holds person {other.elsewhere[w.uav]} as track {other.number}"]
    if holder.number in numbers:
        t = numbers.index(holder.number)
        lines.append(f"expected track {holder.number} in plain view with {format_percent(float(a.before.visible[t]))}")
        weights = a.weights()[t]
        for j in np.argsort(-weights, kind="stable"):
            if weights[j] >= _LEAST and not (w.found and j == w.found.measurement):
                source, place = name_source(int(w.owners[j])), format_place(a.measurements[j])
                gate = f"the gate of track {holder.number} too, weight {format_percent(float(weights[j]))}"
                lines.append(f"the measurement {source} at {place} was in {gate}")
    return lines


def _tell_track(holder: HoldingTrack, facts: PersonFacts) -> list[str]:
    now = float(facts.flight.recording.times[facts.k])
    role = f"stands for the person for {name_fleet(holder.holds)}" if holder.holds else "held the person last"
    lines = [f"{role}; exists since {holder.since:.1f} s, for {now - holder.since:.1f} s"]
    if holder.belief is None:
        return [f"{role}; began at {holder.since:.1f} s; no UAV has it any more"]
    off = holder.belief.mean[:2] - facts.place
    speed = math.hypot(*holder.belief.mean[2:])
    covariance = holder.belief.covariance[:2, :2]
    square, (minor, major) = float(squared_distance(off, covariance)), np.sqrt(np.linalg.eigvalsh(covariance))
    lines.append(f"believed at {format_place(holder.belief.mean[:2])}, {speed:.1f} m/s")
    lines.append(f"error {math.hypot(*off):.2f} m, {math.sqrt(square):.1f} σ (NEES {square:.1f}, 2 expected)")
    lines.append(f"standard deviations {major:.2f} × {minor:.2f} m")
    if not math.isnan(holder.existence):
        unreported = "" if holder.existence > UNLIKELY else ", so it is not reported"
        lines.append(f"existence {holder.existence:.4f}{unreported}")
    return [*lines, *_tell_turns(holder.parts)]


def _tell_turns(parts: Sequence[Track]) -> list[str]:
    """Probabilities that the person of a lost track has turned out of sight, and where to."""
    kept, *turned = parts
    if not turned:
        return []
    turned.sort(key=lambda part: -part.existence)
    ways = []
    for part in turned:
        east, north = part.belief.mean[:2] - part.sighting[:2]
        way = f"{math.hypot(east, north):.0f} m {_name_direction(east, north)}"
        ways.append(f"{way} {format_percent(part.existence)}")
    share = format_percent(math.fsum(part.existence for part in turned))
    return [
        f"by escape={TURN_TIME:g}: goes on as predicted with {format_percent(kept.existence)}, or turned, "
        f"to where no frame of a decision looked, with {share}, from the last detection {', '.join(ways)}"
    ]


def _find_events(facts: PersonFacts) -> list[Event]:
    """Events at the scan that concern the person, tracks of no person, or links and messages."""
    events = facts.flight.events
    k = facts.k
    now = [event for event in events if event.first <= k <= event.last]
    now = [event for event in now if facts.person in (event.person, event.former) or event.kind in UNMATCHED]
    now += list_outages_at(events, facts.flight.recording.times, k)
    return sorted(now, key=lambda event: event.time)


def _tell_intents(facts: PersonFacts) -> list[str]:
    lines = []
    for observation, planned in zip(facts.observations, facts.planned, strict=True):
        if planned is None:
            lines.append(f"UAV {observation.uav}: no plan{'' if observation.works else ', as it has broken down'}")
            continue
        parts = [f"the person {_tell_ahead(planned, planned.person)}"]
        holder = facts.track_of(observation.uav)
        if holder and planned.track is not None:
            parts.insert(0, f"track {holder.number} {_tell_ahead(planned, planned.track)}")
        plan = f"plan of {planned.made:.1f} s to {planned.times[-1]:.1f} s"
        lines.append(f"UAV {observation.uav}, {plan}: " + "; ".join(parts))
    return lines


def _tell_ahead(planned: PlannedVisibility, states: Indices) -> str:
    """The first time at which a place is in view on the planned path, or its state if it never is."""
    for state, words in ((IN_VIEW, "in view"), (HIDDEN, "hidden")):
        ahead = [e for e in find_episodes(states) if e.value == state]
        if ahead:
            first, last = (f"{planned.times[s]:.1f}" for s in ahead[0][:2])
            return f"{words} at {first} s" if first == last else f"{words} from {first} to {last} s"
    return "not known, as the mission ends" if (states < 0).all() else "out of view"


class Stretch(NamedTuple):
    """A period in which a person is described alike."""

    begin: float  # s
    end: float  # s; infinite for the last one
    held: str  # state to the tracks, one of `HOLDS`
    seen: str  # state in the cameras


def find_stretches(facts: PeopleFacts, person: int) -> list[Stretch]:
    """Periods in which a person is described alike, in order of time."""
    times, holds, views = facts.recording.times, facts.hold_states[:, person].tolist(), facts.view_texts(person)
    runs = [[*run] for _, run in groupby(range(len(holds)), key=lambda k: (holds[k], views[k]))]
    return [Stretch(*find_lasting_ends(times, run[0], run[-1]), HOLDS[holds[run[0]]], views[run[0]]) for run in runs]
