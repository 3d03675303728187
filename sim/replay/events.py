"""Events of a recorded mission, told once for the page, the timeline, `understory explain` and Rerun."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from sim.evaluation.fleet_facts import contacts
from sim.mission.plan_exchange import Links, lost_messages, open_links
from sim.mission.snapshot import Ints
from sim.recording.fault_text import read
from sim.recording.recording import Recording
from sim.replay.event import KINDS, Event
from sim.replay.history import History
from sim.replay.losses import unheld_people, unmatched_events
from sim.replay.views import fleet_text
from sim.scenario.random_streams import stream
from sim.scenario.scenario import Scenario

_TOUCHED = {"uav": "UAV", "canopy": "the canopy of tree", "trunk": "the trunk of tree"}


def events_of(recording: Recording, scenario: Scenario, history: History | None = None) -> tuple[Event, ...]:
    """All events, in order of time, then of `KINDS`; `history`, if it is known, is not worked out again."""
    history = history or History.of(recording, scenario)
    found = [
        *_breakdowns(recording, scenario),
        *_faults(recording),
        *_contacts(recording),
        *_links(recording, scenario),
        *_lives(recording),
        *_identities(recording, history),
        *unheld_people(recording, history),
        *unmatched_events(recording),
    ]
    return tuple(sorted(found, key=lambda event: (event.time, KINDS.index(event.kind))))


def _at(recording: Recording, k: int, kind: str, text: str, **concerned: Any) -> Event:  # noqa: ANN401 - fields of Event
    """An event of one scan."""
    time = float(recording.times[k])
    return Event(kind, text, k, k, time, time, **concerned)


def _breakdowns(recording: Recording, scenario: Scenario) -> Iterator[Event]:
    for i, works in enumerate(recording.working.T):
        if not works.all():
            k, exact = int(np.argmin(works)), scenario.uavs[i].fails_at
            time = float(recording.times[k]) if exact is None else exact
            yield Event("breakdown", f"UAV {i} broke down", k, k, time, time, uavs=(i,))


def _faults(recording: Recording) -> Iterator[Event]:
    """Faults of planner and detectors, each kind once, however often; breakdowns are events of their own."""
    times, grouped = recording.times, defaultdict(list)
    for fault in read(recording.faults):
        k = min(int(np.searchsorted(times, fault.time - 1e-6)), len(times) - 1)
        if fault.uav is None or recording.working[k, fault.uav]:
            grouped[fault.uav, fault.message].append((fault.time, k))
    for (uav, message), found in grouped.items():
        (time, first), (until, last) = found[0], found[-1]
        count = f"{len(found)} faults" if len(found) > 1 else "fault"
        text = f"{count} of {'the team' if uav is None else f'UAV {uav}'}"
        yield Event("fault", text, first, last, time, until, message, uavs=() if uav is None else (uav,))


def _contacts(recording: Recording) -> Iterator[Event]:
    for entry in contacts(recording):
        first, last = (int(np.argmin(np.abs(recording.times - entry[name]))) for name in ("time", "until"))
        uav, kind = entry["uav"], entry["kind"]
        touched = "the ground" if kind == "ground" else f"{_TOUCHED.get(kind, 'person')} {entry['other']}"
        text = f"UAV {uav} touched {touched}"
        yield Event("contact", text, first, last, entry["time"], entry["until"], uavs=(uav,))


def _links(recording: Recording, scenario: Scenario) -> Iterator[Event]:
    """Links lost and restored, and the loss of all messages of a scan over one that is up; first, all are up."""
    uavs = recording.poses.shape[1]
    up, silent = ~np.eye(uavs, dtype=np.bool_), np.zeros((uavs, uavs), dtype=np.bool_)
    for k, (works, now) in enumerate(zip(recording.working, links_of(recording, scenario), strict=True)):
        quiet = now.up & ~now.contact
        for kind, changed, words in (
            (
                "link lost",
                np.triu(up & ~now.up & works & works[:, None]),
                "UAV {} and UAV {}: too far, cut or not there",
            ),
            ("link restored", np.triu(now.up & ~up), "UAV {} and UAV {}"),
            ("messages lost", quiet & ~silent, "UAV {} hears nothing of UAV {}"),
            ("messages heard", silent & now.contact, "UAV {} hears UAV {} again"),
        ):
            for i, j in np.argwhere(changed).tolist():
                yield _at(recording, k, kind, words.format(i, j), uavs=(i, j))
        up, silent = now.up, quiet


def _lives(recording: Recording) -> Iterator[Event]:
    """UAVs that begin to hold each track, or cease to; a breakdown ends none."""
    uavs = range(recording.poses.shape[1])
    known: set[int] = set()
    before: list[set[int]] = [set() for _ in uavs]
    for k in range(len(recording.times)):
        now = [set(recording.track_ids_at(k, i).tolist()) for i in uavs]
        ended = [before[i] - now[i] if recording.working[k, i] else set() for i in uavs]
        held = set().union(*now)
        for number, id_, fleet in _holders((now[i] - before[i] for i in uavs), recording):
            kind, words = ("track taken up", "taken up") if id_ in known else ("track born", "born and confirmed")
            yield _at(recording, k, kind, f"track {number} {words} by {fleet_text(fleet)}", track=number, uavs=fleet)
        for number, id_, fleet in _holders(ended, recording):
            kind, words = ("track dropped", "dropped") if id_ in held else ("track deleted", "deleted")
            yield _at(recording, k, kind, f"track {number} {words} by {fleet_text(fleet)}", track=number, uavs=fleet)
        known, before = known | held, now


def _holders(sets: Iterable[set[int]], recording: Recording) -> list[tuple[int, int, tuple[int, ...]]]:
    """Number, id and UAVs of each track in any of the UAVs' sets, by number."""
    fleet = defaultdict(list)
    for i, ids in enumerate(sets):
        for id_ in ids:
            fleet[id_].append(i)
    return sorted((recording.track_numbers[id_], id_, tuple(uavs)) for id_, uavs in fleet.items())


def _identities(recording: Recording, history: History) -> Iterator[Event]:
    """Changes of the track that stands for a person, and of the person for whom it does, each with its UAVs."""
    fleet = defaultdict(list)
    for i in range(history.tracks.shape[1]):
        for change in _changes(history.tracks[:, i], recording.track_numbers):
            fleet[change].append(i)
    for (k, kind, person, former, track, text), uavs in fleet.items():
        text = f"{text} for {fleet_text(uavs)}"
        yield _at(recording, k, kind, text, person=person, former=former, track=track, uavs=tuple(uavs))


def _changes(tracks: Ints, numbers: dict[int, int]) -> Iterator[tuple[int, str, int, int | None, int, str]]:
    """Scan, kind, person, former person, number of the track and words of each change in the tracks (K, M) of one UAV.

    Switches are those that `tracking.metrics.clearmot.switches` counts.
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
                text = f"person {m} swapped track {numbers[before]} for track {now}, that of person {former},"
                yield k, "identity switch", m, former, now, text
        for m in people:
            last[m], owner[int(row[m])] = int(row[m]), m


def links_of(recording: Recording, scenario: Scenario) -> list[Links]:
    """The links of each scan, as the mission had them: they follow from places, scenario, seed and repeat alone."""
    rng, uavs = stream(recording.seed, "network", repeat=recording.repeat), recording.poses.shape[1]
    found = []
    for time, poses, working in zip(recording.times.tolist(), recording.poses, recording.working, strict=True):
        up = open_links(scenario.network, time, poses[:, :3]) & working[:, None] & working
        found.append(Links(np.asarray(up), lost_messages(scenario.network, uavs, rng)))
    return found
