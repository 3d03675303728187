"""Events of a recorded mission, computed once for the page, the timeline, `understory explain` and Rerun."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from sim.facts.event import KINDS, Event, find_ends, make_lasting_event
from sim.facts.fades import tell_fade
from sim.facts.history import STATES, History, Loss, describe_view, group_views, name_fleet
from sim.facts.metrics.fleet_facts import list_contacts
from sim.facts.metrics.handoffs import find_handoffs
from sim.facts.metrics.holding import find_episodes
from sim.facts.metrics.unmatched import find_unmatched_tracks
from sim.mission.recorded_links import find_recorded_links
from sim.mission.recording import Recording
from sim.world.contacts import describe_body
from tracking.numerics.arrays import Indices


def find_events(recording: Recording, history: History) -> tuple[Event, ...]:
    """All events, sorted by time, then in the order of `KINDS`."""
    found = [
        *_list_breakdowns(recording),
        *_list_faults(recording),
        *_list_contacts(recording),
        *_find_link_changes(recording),
        *_find_holding_changes(recording),
        *_list_held_tracks(recording),
        *_find_identity_changes(recording, history),
        *_tell_losses(recording, history),
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


def _find_identity_changes(recording: Recording, history: History) -> Iterator[Event]:
    """Changes of a person's track and of a track's person, each with the UAVs for which it happens."""
    fleet = defaultdict(list)
    for i in range(history.tracks.shape[1]):
        for change in _find_changes(history.tracks[:, i], recording.track_numbers):
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


def _tell_losses(recording: Recording, history: History) -> Iterator[Event]:
    """People lost or not found yet, with their states in the cameras meanwhile, and people found."""
    times = history.times
    for loss in history.losses:
        end, nearest = loss.last + 1, _choose_nearest(recording, history, loss)
        why = _describe_causes(recording, history, loss)
        why += _describe_track(recording, history, loss) if loss.found else ""
        concerned = {"why": why, "person": loss.person, "uavs": (nearest,), "scans": loss.scans}
        text = f"person {loss.person} {loss.kind.removeprefix('person ')}{_describe_gap(history, loss)}"
        yield make_lasting_event(times, (loss.first, loss.last), loss.kind, text, **concerned)
        if end < len(times) and history.held[end, loss.person]:
            uavs = tuple(np.flatnonzero(history.tracks[end, :, loss.person] >= 0).tolist())
            again, after = " again" * loss.found, times[end] - times[loss.first]
            text = f"person {loss.person} found{again} by {name_fleet(uavs)} after {after:.1f} s"
            yield _note_at(recording, end, "person found", text, person=loss.person, uavs=uavs)


def _describe_gap(history: History, loss: Loss) -> str:
    """How far a lost person was from the tracks that held nobody, at worst, and for how long."""
    begin, end = find_ends(history.times, 0, 0)  # of one scan
    for scans, words in zip(loss.scans, (", without a track", ", outside the ellipse of the track"), strict=False):
        if scans and loss.found:
            return words + (f" for {scans * (end - begin):.1f} s" if scans < sum(loss.scans) else "")
    return " the track" if loss.found else ""


def _describe_causes(recording: Recording, history: History, loss: Loss) -> str:
    """Why no camera helped: the best view of a lost person in any camera, in order of time, with durations."""
    scans: dict[tuple[str, tuple[int, ...]], int] = {}
    uavs: defaultdict[tuple[tuple[str, tuple[int, ...]], int], set[int]] = defaultdict(set)  # by key and tree
    for k in range(loss.first, loss.last + 1):
        states, trees = (t[k, :, loss.person] for t in (history.camera_states, history.hiding_trees))
        state, having = group_views(states, trees)[0]
        key = (state, tuple(sorted(having)))
        scans[key] = scans.get(key, 0) + 1
        for tree, fleet in having.items():
            uavs[key, tree].update(fleet)
    most = sorted(scans, key=lambda key: -scans[key])[:_MOST_CAUSES]
    begin, end = find_ends(history.times, 0, 0)  # of one scan
    parts = []
    for key in (key for key in scans if key in most):
        state, between = key
        text = describe_view(state, {tree: sorted(uavs[key, tree]) for tree in between})
        text += f", but no reported track within {recording.setting.loss_distance:g} m" if state == "seen" else ""
        parts.append(text + (f" ({scans[key] * (end - begin):.1f} s)" if len(scans) > 1 else ""))
    return "; ".join(parts)


def _describe_track(recording: Recording, history: History, loss: Loss) -> str:
    column = history.tracks[loss.first - 1, :, loss.person]
    uavs = np.argsort(column < 0, kind="stable").tolist()  # those that held the person before come first
    id_ = int(column[uavs[0]])
    number = recording.track_numbers.get(id_)
    if number is None:
        return ""
    for track in (track for uav in uavs for track in recording.tracks_at(loss.first, uav)):
        if track.id == id_:
            gap = np.hypot(*(track.belief.mean[:2] - recording.people[loss.first, loss.person]))
            doubt = "" if track.reported else f", but not reported (existence {track.existence:.2f})"
            return f"; track {number} is {gap:.1f} m off at first{doubt}"
    return f"; track {number} is gone"


def _choose_nearest(recording: Recording, history: History, loss: Loss) -> int:
    """The UAV with the most informative frames of a loss; the nearest one if the person is inside no frame.

    A UAV with the person inside its frame at the beginning is preferred, then one with most frames of that kind.
    """
    inside = history.camera_states[loss.first : loss.last + 1, :, loss.person] >= STATES.index("hidden")
    if inside.any():
        return int((inside[0] * len(inside) + np.count_nonzero(inside, axis=0)).argmax())
    gap = np.linalg.norm(recording.poses[loss.first, :, :2] - recording.people[loss.first, loss.person], axis=1)
    return int(np.where(history.working[loss.first], gap, np.inf).argmin())


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
