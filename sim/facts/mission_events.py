"""The search for the events of a recorded mission, for the page, the timeline, `understory explain` and Rerun."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from sim.facts.event import KINDS, Event, find_ends, make_lasting_event
from sim.facts.metrics.fleet_facts import list_contacts
from sim.facts.metrics.handoffs import find_handoffs
from sim.facts.metrics.holding import find_episodes
from sim.facts.metrics.unmatched import find_unmatched_tracks
from sim.facts.people import STATES, PeopleFacts, Unheld, describe_view, group_views
from sim.facts.sightings import tell_fade
from sim.facts.words import name_fleet
from sim.mission.recorded_links import find_recorded_links
from sim.mission.recording import Recording
from sim.world.contacts import describe_body
from tracking.numerics.arrays import Array, Indices


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
        *_list_handoffs(recording),
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
    times, grouped = recording.times, defaultdict(list)
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
    """Links lost and restored, and the loss of all messages of a scan over one that is up; first, all are up."""
    uavs = recording.uav_count
    up, silent = ~np.eye(uavs, dtype=np.bool_), np.zeros((uavs, uavs), dtype=np.bool_)
    for k, (works, now) in enumerate(zip(recording.working, find_recorded_links(recording), strict=True)):
        quiet, both = now.up & ~now.contact, works & works[:, None]
        for kind, changed, words in (
            ("link lost", np.triu(up & ~now.up & both), "UAV {} and UAV {}: too far, cut or not there"),
            ("link restored", np.triu(now.up & ~up), "UAV {} and UAV {}"),
            ("messages lost", quiet & ~silent, "UAV {} hears nothing of UAV {}"),
            ("messages heard", silent & now.contact, "UAV {} hears UAV {} again"),
        ):
            for i, j in np.argwhere(changed).tolist():
                yield _note_at(recording, k, kind, words.format(i, j), uavs=(i, j))
        up, silent = now.up, quiet


def _find_holding_changes(recording: Recording) -> Iterator[Event]:
    """UAVs that begin or cease to have each track; a breakdown is neither dropping nor deletion."""
    uavs = range(recording.uav_count)
    given = recording.setting.tracking.initial_tracks == "known"
    known: set[int] = set()
    before: list[set[int]] = [set() for _ in uavs]
    for k in range(len(recording.times)):
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
        held = np.zeros(len(recording.times), dtype=np.int64)
        held[scans[recording.reported & (recording.track_ids == id_)]] = 1
        for first, last, value in find_episodes(held):
            if value:
                text = f"track {number} held"
                yield make_lasting_event(recording.times, (first, last), "track held", text, track=number)


def _group_by_track(sets: Iterable[set[int]], recording: Recording) -> list[tuple[int, int, tuple[int, ...]]]:
    """Number, id and UAVs of each track in any of the UAVs' sets, sorted by number."""
    fleet = defaultdict(list)
    for i, ids in enumerate(sets):
        for id_ in ids:
            fleet[id_].append(i)
    return sorted((recording.track_numbers[id_], id_, tuple(uavs)) for id_, uavs in fleet.items())


def _find_identity_changes(facts: PeopleFacts) -> Iterator[Event]:
    """Changes of a person's track and of a track's person, each with the UAVs for which it happens."""
    recording, fleet = facts.recording, defaultdict(list)
    for i in range(recording.uav_count):
        for change in _find_changes(facts.tracks[:, i], recording.track_numbers):
            fleet[change].append(i)
    for (k, kind, person, former, track, text), uavs in fleet.items():
        text = f"{text} for {name_fleet(uavs)}"
        yield _note_at(recording, k, kind, text, person=person, former=former, track=track, uavs=tuple(uavs))


def _find_changes(tracks: Indices, numbers: dict[int, int]) -> Iterator[tuple[int, str, int, int | None, int, str]]:
    """Scan, kind, person, former person, number of the track and text of each change in the tracks (K, M) of one UAV.

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
                yield k, "identity transfer", m, former, now, f"track {now} passed from person {former} to person {m}"
            elif before != id_ and former == m:
                text = f"person {m} handed over from track {numbers[before]} to track {now}"
                yield k, "identity switch", m, None, now, text
            elif before != id_:
                text = f"person {m} switched from track {numbers[before]} to track {now}, that of person {former},"
                yield k, "identity switch", m, former, now, text
        for m in people:
            last[m], owner[int(row[m])] = int(row[m]), m


def _list_handoffs(recording: Recording) -> Iterator[Event]:
    """Hand-offs of people from UAV to UAV, as `sim.facts.metrics.handoffs` finds them."""
    for k, last, person, uavs in find_handoffs(recording):
        unseen = recording.times[k] - recording.times[last + 1]
        text = f"person {person} passed from UAV {uavs[0]} to UAV {uavs[1]}"
        text += f", unseen for {unseen:.1f} s" if k > last + 1 else ""
        yield _note_at(recording, k, "hand-off", text, person=person, uavs=uavs[::-1])


_MOST_CAUSES = 3


def _tell_unheld(facts: PeopleFacts) -> Iterator[Event]:
    """People whom no UAV holds, with their states in the cameras meanwhile, and people found."""
    recording, times = facts.recording, facts.recording.times
    for span in facts.unheld:
        end, person = span.last + 1, span.person
        why = _describe_causes(facts, span) + (_describe_track(facts, span) if span.found else "")
        text = f"{span.kind.replace('person', f'person {person}')}{_describe_gap(facts, span)}"
        concerned = {"why": why, "person": person, "uavs": (_choose_nearest(facts, span),), "scans": span.scans}
        yield make_lasting_event(times, (span.first, span.last), span.kind, text, **concerned)
        if end < recording.scan_count and facts.held[end, person]:
            uavs = tuple(np.flatnonzero(facts.tracks[end, :, person] >= 0).tolist())
            after = times[end] - times[span.first]
            text = f"person {person} found{' again' * span.found} by {name_fleet(uavs)} after {after:.1f} s"
            yield _note_at(recording, end, "person found", text, person=person, uavs=uavs)


def _compute_scan_time(times: Array) -> float:
    """Time [s] that one scan stands for."""
    begin, end = find_ends(times, 0, 0)
    return end - begin


def _describe_gap(facts: PeopleFacts, span: Unheld) -> str:
    """How far a person was from the tracks that held nobody, at worst, and for how long."""
    scan = _compute_scan_time(facts.recording.times)
    for scans, words in zip(span.scans, (", without a track", ", outside the ellipse of the track"), strict=False):
        if scans and span.found:
            return words + (f" for {scans * scan:.1f} s" if scans < sum(span.scans) else "")
    return " the track" if span.found else ""


def _describe_causes(facts: PeopleFacts, span: Unheld) -> str:
    """Why no camera helped: the best view of the person in any camera, in order of time, with durations.

    A reason why people are lost has its state in `people.STATES` and its words in `people.describe_view`.
    """
    scans: Counter[tuple[str, tuple[int, ...]]] = Counter()
    uavs: defaultdict[tuple[tuple[str, tuple[int, ...]], int], set[int]] = defaultdict(set)  # by key and tree
    for k in range(span.first, span.last + 1):
        states, trees = (table[k, :, span.person] for table in (facts.camera_states, facts.hiding_trees))
        state, having = group_views(states, trees)[0]
        key = (state, tuple(sorted(having)))
        scans[key] += 1
        for tree, fleet in having.items():
            uavs[key, tree].update(fleet)
    scan = _compute_scan_time(facts.recording.times)
    most = [key for key, _ in scans.most_common(_MOST_CAUSES)]
    parts = []
    for key in (key for key in scans if key in most):
        state, between = key
        text = describe_view(state, {tree: sorted(uavs[key, tree]) for tree in between})
        near = f"within {facts.recording.setting.loss_distance:g} m"
        text += f", but no reported track {near}" if state == "seen" else ""
        parts.append(text + (f" ({scans[key] * scan:.1f} s)" if len(scans) > 1 else ""))
    return "; ".join(parts)


def _describe_track(facts: PeopleFacts, span: Unheld) -> str:
    recording, k = facts.recording, span.first
    column = facts.tracks[k - 1, :, span.person]
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
        number, span = recording.track_numbers[found.id], (found.first, found.last)
        uavs = tuple(np.flatnonzero(found.alone.any(axis=0)).tolist())
        near = "" if found.nearest is None else f", {found.gap:.1f} m from person {found.nearest}"
        near = near if found.left is None or found.duplicate else f" after its person {found.left} left"
        cost = f"{np.nanmax(recording.ospa[found.first : found.last + 1, uavs, 2]):.1f}"
        part = "" if cost == "0.0" else f"; OSPA's cardinality part is up to {cost} m"
        why = f"held by {name_fleet(uavs)}{near}{part}"
        person = found.nearest if found.duplicate else None
        stands = f"is person {found.nearest}'s second one" if found.duplicate else "stands for no person"
        kind, text = "duplicate track" if found.duplicate else "false track", f"track {number} {stands}"
        yield make_lasting_event(recording.times, span, kind, text, why=why, person=person, track=number, uavs=uavs)
