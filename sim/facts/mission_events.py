"""The search for the events of a recorded mission, for the page, the timeline, `understory explain` and Rerun."""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from sim.facts.event import KINDS, Event, find_ends, make_lasting_event
from sim.facts.metrics.fleet_facts import find_handoffs, list_contacts
from sim.facts.metrics.holding import FAR, NO_TRACK, OUTSIDE, Unheld, find_episodes
from sim.facts.metrics.trees_met import find_trees_met
from sim.facts.metrics.unmatched import find_unmatched_tracks
from sim.facts.people import PeopleFacts, describe_view, group_views
from sim.facts.sightings import STATES, tell_fade
from sim.facts.words import name_fleet
from sim.mission.radio import find_broken_links
from sim.mission.recorded_links import find_recorded_links
from sim.mission.recording import Recording
from sim.world.contacts import describe_body
from tracking.numerics.arrays import Array, Flags, Indices


def find_events(facts: PeopleFacts) -> tuple[Event, ...]:
    """All events of a recording, sorted by time, then in the order of `KINDS`."""
    recording = facts.recording
    found = [
        *_list_breakdowns(recording),
        *_list_faults(recording),
        *_list_contacts(recording),
        *_find_link_changes(recording),
        *_find_holding_changes(recording),
        *_list_held_tracks(recording),
        *_find_identity_changes(facts),
        *_tell_unheld(facts),
        *_list_unmatched(recording),
        *_list_visits(recording),
        *_list_handoffs(recording),
        *_list_trees_met(recording),
    ]
    return tuple(sorted(found, key=lambda event: (event.time, KINDS.index(event.kind))))


def _note_at(recording: Recording, k: int, kind: str, text: str, **concerned: Any) -> Event:  # noqa: ANN401 - fields of Event
    """An event that takes no time."""
    time = float(recording.times[k])
    return Event(kind, text, k, k, time, time, **concerned)


def _list_breakdowns(recording: Recording) -> Iterator[Event]:
    for i, works in enumerate(recording.working.T):
        if not works.all():
            k, exact = int(np.argmin(works)), recording.setting.uavs[i].fails_at
            time = float(recording.times[k]) if exact is None else exact
            yield Event("breakdown", f"UAV {i} broke down", k, k, time, time, uavs=(i,))


def _list_faults(recording: Recording) -> Iterator[Event]:
    """Faults of planner and detectors, each kind once for all its UAVs; breakdowns are separate events."""
    times = recording.times
    grouped = defaultdict(list)
    for fault in recording.all_faults:
        k = min(int(np.searchsorted(times, fault.time - 1e-6)), len(times) - 1)
        if fault.uav is None or recording.working[k, fault.uav]:
            grouped[fault.uav is None, fault.message].append((fault.time, k, fault.uav))
    for (_, message), found in grouped.items():
        (time, first, _), (until, last, _) = found[0], found[-1]
        uavs = tuple(sorted({uav for *_, uav in found if uav is not None}))
        count = f"{len(found)} faults" if len(found) > 1 else "fault"
        text = f"{count} of {name_fleet(uavs) if uavs else 'the team'}"
        yield Event("fault", text, first, last, time, until, message, uavs=uavs)


def _list_contacts(recording: Recording) -> Iterator[Event]:
    for entry in list_contacts(recording):
        first, last = (int(np.argmin(np.abs(recording.times - entry[name]))) for name in ("time", "until"))
        text = f"UAV {entry['uav']} touched {describe_body(entry['kind'], entry['other'])}"
        yield Event("contact", text, first, last, entry["time"], entry["until"], uavs=(entry["uav"],))


def _find_link_changes(recording: Recording) -> Iterator[Event]:
    """Spans of UAVs that work without a link, or with one but without a message, and what ends them."""
    links, network = find_recorded_links(recording), recording.setting.network
    up, heard = np.array([now.up for now in links]), np.array([now.contact for now in links])
    both = recording.working[:, :, None] & recording.working[:, None]
    rows = zip(recording.times.tolist(), recording.poses[:, :, :3], strict=True)
    broken = [find_broken_links(network, time, places) for time, places in rows]
    reasons = {name: np.array([now[name] for now in broken]) for name in broken[0]}
    for i, j in permutations(range(recording.uav_count), 2):
        if i < j:
            for first, last in _find_spans(both[:, i, j] & ~up[:, i, j]):
                why = ", ".join(name for name, mask in reasons.items() if mask[first : last + 1, i, j].any())
                text = f"UAV {i} and UAV {j}"
                yield make_lasting_event(recording.times, (first, last), "link lost", text, why=why, uavs=(i, j))
                if last + 1 < len(up) and up[last + 1, i, j]:
                    yield _note_at(recording, last + 1, "link restored", text, uavs=(i, j))
        for first, last in _find_spans(up[:, i, j] & ~heard[:, i, j]):
            text = f"UAV {i} hears nothing of UAV {j}"
            yield make_lasting_event(recording.times, (first, last), "messages lost", text, uavs=(i, j))
            if last + 1 < len(up) and heard[last + 1, i, j]:
                yield _note_at(recording, last + 1, "messages heard", f"UAV {i} hears UAV {j} again", uavs=(i, j))


def _find_spans(mask: Flags) -> list[tuple[int, int]]:
    """First and last scans of the spans in which a mask (K,) is true."""
    return [(first, last) for first, last, value in find_episodes(mask.astype(np.int64)) if value]


def _find_holding_changes(recording: Recording) -> Iterator[Event]:
    """UAVs that begin or cease to have each track; a breakdown is neither dropping nor deletion."""
    uavs = range(recording.uav_count)
    given = recording.setting.tracking.initial_tracks == "known"
    known: set[int] = set()
    before: list[set[int]] = [set() for _ in uavs]
    for k in range(recording.scan_count):
        now = [set(recording.track_ids_at(k, i).tolist()) for i in uavs]
        gone = [before[i] - now[i] if recording.working[k, i] else set() for i in uavs]
        held = set().union(*now)
        for number, id_, fleet in _group_by_track((now[i] - before[i] for i in uavs), recording):
            first = "known at the start to" if given and k == 0 else "born and confirmed by"
            kind, words = ("track received", "received by") if id_ in known else ("track born", first)
            yield _note_at(recording, k, kind, f"track {number} {words} {name_fleet(fleet)}", track=number, uavs=fleet)
        for number, id_, fleet in _group_by_track(gone, recording):
            kind, words = ("track dropped", "dropped") if id_ in held else ("track deleted", "deleted")
            why = "" if recording.labelled or id_ in held else tell_fade(recording, id_, k - 1)
            text = f"track {number} {words} by {name_fleet(fleet)}"
            yield _note_at(recording, k, kind, text, why=why, track=number, uavs=fleet)
        known, before = known | held, now


def _list_held_tracks(recording: Recording) -> Iterator[Event]:
    """Spans in which any UAV reports a track, in a flight whose people are unknown."""
    scans, _ = recording.cells(recording.track_offsets)
    for id_, number in recording.track_numbers.items() if not recording.labelled else ():
        held = np.zeros(recording.scan_count, dtype=np.bool_)
        held[scans[recording.reported & (recording.track_ids == id_)]] = True
        for span in _find_spans(held):
            yield make_lasting_event(recording.times, span, "track held", f"track {number} held", track=number)


def _group_by_track(sets: Iterable[set[int]], recording: Recording) -> list[tuple[int, int, tuple[int, ...]]]:
    """Number, id and UAVs of each track in any of the UAVs' sets, sorted by number."""
    fleet = defaultdict(list)
    for i, ids in enumerate(sets):
        for id_ in ids:
            fleet[id_].append(i)
    return sorted((recording.track_numbers[id_], id_, tuple(uavs)) for id_, uavs in fleet.items())


def _find_identity_changes(facts: PeopleFacts) -> Iterator[Event]:
    """Changes of a person's track and of a track's person, each with the UAVs for which it happens."""
    recording = facts.recording
    fleet = defaultdict(list)
    for i in range(recording.uav_count):
        for change in _find_changes(facts.tracks[:, i], recording.track_numbers):
            fleet[change].append(i)
    for change, uavs in fleet.items():
        concerned = {"person": change.person, "former": change.former, "track": change.track, "uavs": tuple(uavs)}
        yield _note_at(recording, change.scan, change.kind, f"{change.text} for {name_fleet(uavs)}", **concerned)


class _Change(NamedTuple):
    """A person has another track than before, or a track another person."""

    scan: int
    kind: str
    person: int
    former: int | None  # person for whom the track stood before
    track: int  # number
    text: str


def _find_changes(tracks: Indices, numbers: dict[int, int]) -> Iterator[_Change]:
    """Each change in the tracks (K, M) of one UAV.

    Switches are those of `tracking.metrics.clearmot.count_switches`.
    """
    last: dict[int, int] = {}  # by person
    owner: dict[int, int] = {}  # by track
    for k, row in enumerate(tracks):
        people = np.flatnonzero(row >= 0).tolist()
        for m in people:
            id_ = int(row[m])
            before, former, now = last.get(m, id_), owner.get(id_, m), numbers[id_]
            if before == id_ and former != m:
                text = f"track {now} passed from person {former} to person {m}"
                yield _Change(k, "identity transfer", m, former, now, text)
            elif before != id_ and former == m:
                text = f"person {m} handed over from track {numbers[before]} to track {now}"
                yield _Change(k, "identity switch", m, None, now, text)
            elif before != id_:
                text = f"person {m} switched from track {numbers[before]} to track {now}, that of person {former},"
                yield _Change(k, "identity switch", m, former, now, text)
        for m in people:
            last[m], owner[int(row[m])] = int(row[m]), m


def _list_handoffs(recording: Recording) -> Iterator[Event]:
    """Hand-offs of people from UAV to UAV, as `sim.facts.metrics.fleet_facts` finds them."""
    for k, last, person, uavs in find_handoffs(recording):
        unseen = recording.times[k] - recording.times[last + 1]
        text = f"person {person} passed from UAV {uavs[0]} to UAV {uavs[1]}"
        text += f", unseen for {unseen:.1f} s" if k > last + 1 else ""
        yield _note_at(recording, k, "hand-off", text, person=person, uavs=uavs[::-1])


def _list_visits(recording: Recording) -> Iterator[Event]:
    """People who leave the area or come into it after the start."""
    for person, present in enumerate(recording.present.T):
        left = math.nan  # s
        for k in (np.flatnonzero(np.diff(present)) + 1).tolist():
            time = float(recording.times[k])
            if present[k]:
                again = "" if math.isnan(left) else f" again after {time - left:.1f} s"
                yield _note_at(recording, k, "person came", f"person {person} came{again}", person=person)
            else:
                left = time
                yield _note_at(recording, k, "person left", f"person {person} left the area", person=person)


def _list_trees_met(recording: Recording) -> Iterator[Event]:
    """Trees that UAVs meet and have on their maps from others."""
    for k, uav, tree, ahead in find_trees_met(recording):
        if not math.isnan(ahead):
            text = f"UAV {uav} came to tree {tree}, which it had from others for {ahead:.1f} s"
            yield _note_at(recording, k, "tree met", text, uavs=(uav,))


_MOST_CAUSES = 3


def _tell_unheld(facts: PeopleFacts) -> Iterator[Event]:
    """Losses, with the states of their people in the cameras meanwhile, and people found."""
    recording, times = facts.recording, facts.recording.times
    for span in facts.unheld:
        end = span.last + 1
        person = span.person
        why = _describe_causes(facts, span) + (_describe_track(facts, span) if span.found else "")
        text = f"person {person} {span.grade}{_describe_gap(facts, span)}"
        concerned = {"why": why, "person": person, "uavs": (_choose_nearest(facts, span),), "scans": span.scans}
        yield make_lasting_event(times, (span.first, span.last), f"person {span.grade}", text, **concerned)
        if end < recording.scan_count and facts.held[end, person]:
            uavs = tuple(np.flatnonzero(facts.tracks[end, :, person] >= 0).tolist())
            after = times[end] - times[span.since]
            text = f"person {person} found{' again' * span.found} by {name_fleet(uavs)} after {after:.1f} s"
            yield _note_at(recording, end, "person found", text, person=person, uavs=uavs)


def _list_seconds(recording: Recording, span: Unheld) -> Array:
    """Time [s] that each scan of a span represents."""
    return np.diff([find_ends(recording.times, k, k) for k in range(span.first, span.last + 1)])[:, 0]


def _describe_gap(facts: PeopleFacts, span: Unheld) -> str:
    """How far a lost person was from the tracks that held nobody, at worst, and for how long."""
    if span.grade != "lost":
        return ""
    worst = NO_TRACK if span.scans[0] else OUTSIDE
    for_as_long = facts.holding.gaps[span.first : span.last + 1, span.person] == worst
    words = f", without a track within {FAR:g} m" if span.scans[0] else ", outside the ellipse of the track"
    seconds = _list_seconds(facts.recording, span)[for_as_long].sum()
    return words + ("" if for_as_long.all() else f" for {seconds:.1f} s")


def _describe_causes(facts: PeopleFacts, span: Unheld) -> str:
    """Why no camera helped: the best view of the person in any camera, in order of time, with durations.

    A reason why people are lost has its state in `sightings.STATES` and its words in `people.describe_view`.
    """
    shares: defaultdict[tuple[str, tuple[int, ...]], float] = defaultdict(float)  # s
    uavs: defaultdict[tuple[tuple[str, tuple[int, ...]], int], set[int]] = defaultdict(set)  # by key and tree
    for k, seconds in enumerate(_list_seconds(facts.recording, span).tolist(), span.first):
        states, trees = (table[k, :, span.person] for table in (facts.camera_states, facts.hiding_trees))
        state, having = group_views(states, trees)[0]
        key = (state, tuple(sorted(having)))
        shares[key] += seconds
        for tree, fleet in having.items():
            uavs[key, tree].update(fleet)
    most = sorted(shares, key=lambda key: -shares[key])[:_MOST_CAUSES]
    parts = []
    for key in (key for key in shares if key in most and (shares[key] or len(shares) == 1)):
        state, between = key
        text = describe_view(state, {tree: sorted(uavs[key, tree]) for tree in between})
        near = f"within {facts.recording.setting.loss_distance:g} m"
        text += f", but no reported track {near}" if state == "seen" else ""
        parts.append(text + (f" ({shares[key]:.1f} s)" if len(shares) > 1 else ""))
    return "; ".join(parts)


def _describe_track(facts: PeopleFacts, span: Unheld) -> str:
    recording = facts.recording
    k = span.first
    column = facts.tracks[span.since - 1, :, span.person]
    uavs = np.argsort(column < 0, kind="stable").tolist()  # those that held the person before come first
    id_ = int(column[uavs[0]])
    number = recording.track_numbers.get(id_)
    if number is None:
        return ""
    for track in (track for uav in uavs for track in recording.tracks_at(k, uav)):
        if track.id == id_:
            gap = np.hypot(*(track.belief.mean[:2] - recording.people[k, span.person]))
            doubt = "" if track.reported else f", but not reported (existence {track.existence:.2f})"
            return f"; track {number} is {gap:.1f} m off at first{doubt}"
    return f"; track {number} is gone"


def _choose_nearest(facts: PeopleFacts, span: Unheld) -> int:
    """The UAV with the most informative frames of the span; the nearest one if the person is inside no frame.

    A UAV with the person inside its frame at the beginning is preferred, then one with most frames of that kind.
    """
    inside = facts.camera_states[span.first : span.last + 1, :, span.person] >= STATES.index("hidden")
    if inside.any():
        return int((inside[0] * len(inside) + np.count_nonzero(inside, axis=0)).argmax())
    recording = facts.recording
    gap = np.linalg.norm(recording.poses[span.first, :, :2] - recording.people[span.first, span.person], axis=1)
    return int(np.where(recording.working[span.first], gap, np.inf).argmin())


def _list_unmatched(recording: Recording) -> Iterator[Event]:
    """False tracks and duplicates, as `sim.facts.metrics.unmatched` finds them."""
    for found in find_unmatched_tracks(recording):
        number = recording.track_numbers[found.id]
        span = (found.first, found.last)
        uavs = tuple(np.flatnonzero(found.alone.any(axis=0)).tolist())
        near = "" if found.nearest is None else f", {found.gap:.1f} m from person {found.nearest}"
        near = near if found.left is None or found.duplicate else f" after its person {found.left} left"
        cost = f"{np.nanmax(recording.ospa[found.first : found.last + 1, uavs, 2]):.1f}"
        part = "" if cost == "0.0" else f"; OSPA's cardinality part is up to {cost} m"
        why = f"held by {name_fleet(uavs)}{near}{part}"
        person = found.nearest if found.duplicate else None
        stands = f"is person {found.nearest}'s second one" if found.duplicate else "stands for no person"
        kind = "duplicate track" if found.duplicate else "false track"
        text = f"track {number} {stands}"
        yield make_lasting_event(recording.times, span, kind, text, why=why, person=person, track=number, uavs=uavs)
