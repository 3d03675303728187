"""What happened in a recorded mission, in words: to tracks, people, links and UAVs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from sim.mission.snapshot import Ints
from sim.recording.fault_text import read
from sim.recording.recording import Recording
from sim.replay.history import STATES, History, Loss
from sim.replay.links import links_of
from sim.scenario.scenario import Scenario

KINDS = (
    "breakdown",
    "fault",
    "contact",
    "link lost",
    "link restored",
    "messages lost",  # all of a scan, from one UAV to another
    "messages heard",
    "track born",  # recorded tracks are confirmed ones
    "track taken up",
    "track dropped",
    "track deleted",
    "identity changed",
    "person lost",
    "person found",
)


class Event(NamedTuple):
    """Something that happened."""

    time: float  # s
    kind: str  # one of `KINDS`
    text: str  # tracks under their numbers


def events_of(recording: Recording, scenario: Scenario, history: History | None = None) -> tuple[Event, ...]:
    """All that happened, in order of time, then of `KINDS`; `history`, if it is known, is not worked out again."""
    history = history or History.of(recording, scenario)
    found = [
        *_failures(recording, scenario),
        *_contacts(recording),
        *_links(recording, scenario),
        *_lives(recording),
        *_identities(recording, history),
        *_losses(recording, history),
    ]
    return tuple(sorted(found, key=lambda event: (event.time, KINDS.index(event.kind))))


def _failures(recording: Recording, scenario: Scenario) -> Iterator[Event]:
    """Breakdowns, and what planner and detector did wrong."""
    broken = {i: uav.fails_at for i, uav in enumerate(scenario.uavs) if not recording.working[:, i].all()}
    for i, time in broken.items():
        yield Event(time or 0.0, "breakdown", f"UAV {i} broke down")
    for fault in read(recording.faults):
        if fault.uav is None or broken.get(fault.uav) != fault.time:
            who = "team" if fault.uav is None else f"UAV {fault.uav}"
            yield Event(fault.time, "fault", f"{who}: {fault.message}")


def _contacts(recording: Recording) -> Iterator[Event]:
    for k, time in enumerate(recording.times.tolist()):
        for contact in recording.contacts_at(k):
            other = "the ground" if contact.kind == "ground" else f"{contact.kind} {contact.other}"
            yield Event(time, "contact", f"UAV {contact.uav} touched {other}")


def _links(recording: Recording, scenario: Scenario) -> Iterator[Event]:
    """When links go and come back, and when all messages of a scan over one that is up are lost; first, all are up."""
    uavs = recording.poses.shape[1]
    up, silent = ~np.eye(uavs, dtype=np.bool_), np.zeros((uavs, uavs), dtype=np.bool_)
    for time, works, now in zip(
        recording.times.tolist(), recording.working, links_of(recording, scenario), strict=True
    ):
        quiet = now.up & ~now.touch
        for kind, changed, words in (
            (
                "link lost",
                np.triu(up & ~now.up & works & works[:, None]),
                "UAV {} and UAV {}: too far, cut or not there",
            ),
            ("link restored", np.triu(now.up & ~up), "UAV {} and UAV {}"),
            ("messages lost", quiet & ~silent, "UAV {} hears nothing of UAV {}"),
            ("messages heard", silent & now.touch, "UAV {} hears UAV {} again"),
        ):
            for i, j in np.argwhere(changed).tolist():
                yield Event(time, kind, words.format(i, j))
        up, silent = now.up, quiet


def _lives(recording: Recording) -> Iterator[Event]:
    """Which UAVs begin to hold each track, and cease to; a breakdown ends none."""
    numbers, uavs = recording.track_numbers, range(recording.poses.shape[1])
    known: set[int] = set()
    before: list[set[int]] = [set() for _ in uavs]
    for k, time in enumerate(recording.times.tolist()):
        now = [set(recording.track_ids_at(k, i).tolist()) for i in uavs]
        ended = [before[i] - now[i] if recording.working[k, i] else set() for i in uavs]
        held = set().union(*now)
        for id_, who in _holders((now[i] - before[i] for i in uavs), numbers):
            kind, words = ("track taken up", "taken up") if id_ in known else ("track born", "born and confirmed")
            yield Event(time, kind, f"track {numbers[id_]} {words} by {who}")
        for id_, who in _holders(ended, numbers):
            kind, words = ("track dropped", "dropped") if id_ in held else ("track deleted", "deleted")
            yield Event(time, kind, f"track {numbers[id_]} {words} by {who}")
        known, before = known | held, now


def _holders(sets: Iterable[set[int]], numbers: dict[int, int]) -> Iterator[tuple[int, str]]:
    """Each id in any of the UAVs' sets, by number, and the UAVs in words."""
    who = defaultdict(list)
    for i, ids in enumerate(sets):
        for id_ in ids:
            who[id_].append(i)
    return ((id_, _fleet(who[id_])) for id_ in sorted(who, key=numbers.__getitem__))


def _fleet(uavs: Iterable[int]) -> str:
    return "UAV " + ", ".join(map(str, uavs))


def _identities(recording: Recording, history: History) -> Iterator[Event]:
    """When the track that stands for a person is another one than before, to which UAVs."""
    numbers, who = recording.track_numbers, defaultdict(list)
    for i in range(history.tracks.shape[1]):
        for k, text in _changes(history.tracks[:, i], numbers):
            who[k, text].append(i)
    for (k, text), uavs in who.items():
        yield Event(float(recording.times[k]), "identity changed", f"{text} to {_fleet(uavs)}")


def _changes(tracks: Ints, numbers: dict[int, int]) -> Iterator[tuple[int, str]]:
    """The scans at which people have another track (K, M) than they had last, in words."""
    last: dict[int, int] = {}  # by person
    owner: dict[int, int] = {}  # by track
    for k, row in enumerate(tracks):
        for m in np.flatnonzero(row >= 0).tolist():
            id_ = int(row[m])
            if last.get(m, id_) != id_:
                was, now = numbers[last[m]], numbers[id_]
                if owner.get(id_, m) == m:
                    yield k, f"person {m} handed over from track {was} to track {now}"
                else:
                    yield k, f"person {m} swapped track {was} for track {now}, that of person {owner[id_]},"
        for m in np.flatnonzero(row >= 0).tolist():
            last[m], owner[int(row[m])] = int(row[m]), m


def _losses(recording: Recording, history: History) -> Iterator[Event]:
    """When no UAV holds a person any more, and when one does again."""
    times = recording.times
    for loss in history.losses:
        if loss.found:
            why = _whereabouts(history, loss) + _track(recording, history, loss)
            yield Event(float(times[loss.first]), "person lost", f"person {loss.person} lost by all UAVs: {why}")
        end = loss.last + 1
        if end < len(times) and history.held[end, loss.person]:
            uavs = np.flatnonzero(history.tracks[end, :, loss.person] >= 0).tolist()
            again = " again" if loss.found else ""
            text = f"person {loss.person} found{again} by {_fleet(uavs)} after {times[end] - times[loss.first]:.1f} s"
            yield Event(float(times[end]), "person found", text)


def _whereabouts(history: History, loss: Loss) -> str:
    """Where the cameras had the person when they were lost."""
    if not history.working[loss.first].any():
        return "no UAV works"
    state = STATES[history.states[loss.first, loss.person]]
    trees = history.hidden_by[loss.first, :, loss.person]
    behind = [f"from UAV {i} by tree {trees[i]}" for i in np.flatnonzero(trees >= 0).tolist()]
    if state == "hidden" and behind:
        return f"hidden {', '.join(behind)}"
    return {"seen": "although detected", "missed": "shown, but not detected"}.get(state, state)


def _track(recording: Recording, history: History, loss: Loss) -> str:
    """What became of the track that had stood for the person."""
    column = history.tracks[loss.first - 1, :, loss.person]
    uav = int(np.argmax(column >= 0))
    number = recording.track_numbers.get(int(column[uav]))
    if number is None:
        return ""
    for track in recording.tracks_at(loss.first, uav):
        if track.id == column[uav]:
            gap = np.hypot(*(track.belief.mean[:2] - recording.people[loss.first, loss.person]))
            return f"; track {number} is {gap:.1f} m off"
    return f"; track {number} is gone"
