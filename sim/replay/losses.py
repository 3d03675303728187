"""Events of tracks against the truth: people that no UAV holds, and tracks that stand for no person."""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from sim.evaluation.score import HELD
from sim.evaluation.unmatched import unmatched_tracks
from sim.recording.recording import Recording
from sim.replay.event import Event
from sim.replay.history import STATES, History, Loss
from sim.replay.views import fleet_text, view_text, views_at

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


def unmatched_events(recording: Recording) -> Iterator[Event]:
    """False tracks and duplicates, as `sim.evaluation.unmatched` finds them."""
    for found in unmatched_tracks(recording):
        first, last = found.first, found.last
        number, times = recording.track_numbers[found.id], recording.times
        uavs = tuple(np.flatnonzero(found.alone.any(axis=0)).tolist())
        near = "" if found.nearest is None else f", {found.gap:.1f} m from person {found.nearest}"
        cost = np.nanmax(recording.ospa[first : last + 1, uavs, 2])
        stands = f"is person {found.nearest}'s second one" if found.duplicate else "stands for no person"
        yield Event(
            kind="duplicate track" if found.duplicate else "false track",
            text=f"track {number} {stands}",
            first=first,
            last=last,
            time=float(times[first]),
            until=np.inf if last == len(times) - 1 and last > first else float(times[last]),
            why=f"held by {fleet_text(uavs)}{near}; OSPA's cardinality part is up to {cost:.1f} m",
            person=found.nearest if found.duplicate else None,
            track=number,
            uavs=uavs,
        )
