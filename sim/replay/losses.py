"""Events of tracks against the truth: people that no UAV holds, and tracks that stand for no person."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from sim.evaluation.score import FAR, HELD, Held, held_by
from sim.mission.snapshot import Bools, Ints
from sim.recording.recording import Recording
from sim.replay.event import Event
from sim.replay.history import STATES, History, Loss, episodes
from sim.replay.views import fleet_text, view_text, views_at
from tracking.metrics.clearmot import correspondence
from tracking.numerics.arrays import Array

_MOST_CAUSES = 3


def unheld_people(recording: Recording, history: History) -> Iterator[Event]:
    """People lost or not found yet, with what cameras had of them meanwhile, and people found."""
    times = history.times
    for loss in history.losses:
        end, open_ = loss.last + 1, loss.last == len(times) - 1
        yield Event(
            kind="person lost" if loss.found else "person not found yet",
            text=f"person {loss.person} {'lost' if loss.found else 'not found yet'}",
            first=loss.first,
            last=loss.last,
            time=float(times[loss.first]),
            until=np.inf if open_ else float(times[loss.last]),
            why=_causes(history, loss) + (_track(recording, history, loss) if loss.found else ""),
            person=loss.person,
            uavs=(_nearest(recording, history, loss),),
        )
        if not open_ and history.held[end, loss.person]:
            uavs = tuple(np.flatnonzero(history.tracks[end, :, loss.person] >= 0).tolist())
            again, after = " again" * loss.found, times[end] - times[loss.first]
            text = f"person {loss.person} found{again} by {fleet_text(uavs)} after {after:.1f} s"
            time = float(times[end])
            yield Event("person found", text, end, end, time, time, person=loss.person, uavs=uavs)


def _causes(history: History, loss: Loss) -> str:
    """The best states that cameras had of a lost person, in order of time, with how long each lasted."""
    scans: dict[tuple[str, tuple[int, ...]], int] = {}
    uavs: defaultdict[tuple[str, int], set[int]] = defaultdict(set)  # by state and tree
    for k in range(loss.first, loss.last + 1):
        states, trees = (t[k, :, loss.person] for t in (history.camera_states, history.hiding_trees))
        state, having = views_at(states, trees)[0]
        key = (state, tuple(sorted(having)))
        scans[key] = scans.get(key, 0) + 1
        for tree, fleet in having.items():
            uavs[state, tree].update(fleet)
    most = sorted(scans, key=lambda key: -scans[key])[:_MOST_CAUSES]
    step = float(history.times[1] - history.times[0]) if len(history.times) > 1 else 0.0
    parts = []
    for state, between in (key for key in scans if key in most):
        text = view_text(state, {tree: sorted(uavs[state, tree]) for tree in between})
        text += f", but no track within {HELD:g} m" if state == "seen" else ""
        parts.append(text + (f" ({scans[state, between] * step:.1f} s)" if len(scans) > 1 else ""))
    return "; ".join(parts)


def _track(recording: Recording, history: History, loss: Loss) -> str:
    """The fate of the track that had stood for a person."""
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


def _nearest(recording: Recording, history: History, loss: Loss) -> int:
    """The UAV with the most telling frames of a loss: the person is inside most of them, or else it is the nearest."""
    states = history.camera_states[loss.first : loss.last + 1, :, loss.person]
    inside = np.count_nonzero(states >= STATES.index("hidden"), axis=0)
    if inside.any():
        return int(inside.argmax())
    gap = np.linalg.norm(recording.poses[loss.first, :, :2] - recording.people[loss.first, loss.person], axis=1)
    return int(np.where(history.working[loss.first], gap, np.inf).argmin())


def unmatched_tracks(recording: Recording, history: History) -> Iterator[Event]:
    """False tracks and duplicates: those that stand for no person, nor are within `FAR` m of a lost one.

    They are what GOSPA counts as false. One within `HELD` m of a person, that another track stands for, is a duplicate.
    """
    uavs = history.working.shape[1]
    alone: defaultdict[int, Bools] = defaultdict(lambda: np.zeros(history.working.shape, dtype=np.bool_))
    for i in range(uavs):
        held = held_by(recording, i)
        free = _unmatched_by(held, history.tracks[:, i], recording.people) & history.working[:, i, None]
        for column in np.flatnonzero(free.any(axis=0)).tolist():
            alone[int(held.ids[column])][:, i] = free[:, column]
    for id_, table in alone.items():
        for first, last, value in episodes(np.asarray(table.any(axis=1), dtype=np.int64)):
            if value:
                yield _unmatched(recording, id_, table, (first, last))


def _unmatched_by(held: Held, standing: Ints, people: Array) -> Bools:
    """Tracks (K, A) of one UAV that stand for no person; standing (K, M): ids of those that do, -1 for none."""
    stands = (held.ids == standing[:, :, None]).any(axis=1)
    places = np.where(stands[:, :, None], np.nan, held.means[:, :, :2])
    lost = np.where((standing >= 0)[:, :, None], np.nan, people)
    free = ~np.isnan(places[:, :, 0])
    matched = correspondence(places, lost, FAR)
    k, m = np.nonzero(matched >= 0)
    free[k, matched[k, m]] = False
    return free


def _unmatched(recording: Recording, id_: int, alone: Bools, span: tuple[int, int]) -> Event:
    """The event of one track that stands for no person; alone (K, n): by scan and UAV."""
    first, last = span
    number, times = recording.track_numbers[id_], recording.times
    uavs = tuple(np.flatnonzero(alone[first : last + 1].any(axis=0)).tolist())
    gaps = np.array([_gaps(recording, k, int(alone[k].argmax()), id_) for k in range(first, last + 1)])
    nearest = np.median(gaps, axis=0) if gaps.size else np.array([np.inf])
    person = int(np.argmin(nearest))
    double = nearest[person] <= HELD
    near = f", {nearest[person]:.1f} m from person {person}" if np.isfinite(nearest[person]) else ""
    cost = np.nanmax(recording.ospa[first : last + 1, uavs, 2])
    return Event(
        kind="duplicate track" if double else "false track",
        text=f"track {number} " + (f"is a second one of person {person}" if double else "stands for no person"),
        first=first,
        last=last,
        time=float(times[first]),
        until=np.inf if last == len(times) - 1 and last > first else float(times[last]),
        why=f"held by {fleet_text(uavs)}{near}; OSPA's cardinality part is up to {cost:.1f} m",
        person=person if double else None,
        track=number,
        uavs=uavs,
    )


def _gaps(recording: Recording, k: int, uav: int, id_: int) -> list[float]:
    """Distances [m] (M,) of one track of a UAV from all people at scan k; infinite from absent ones."""
    (track,) = (t for t in recording.tracks_at(k, uav) if t.id == id_)
    gaps = np.hypot(*(recording.people[k] - track.belief.mean[:2]).T)
    return [float(gap) for gap in np.where(np.isnan(gaps), np.inf, gaps)]
