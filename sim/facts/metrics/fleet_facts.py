"""Measures of a whole fleet: OSPA, contacts, bytes, disagreement, hand-offs, sources of error, times to find people."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from sim.facts.metrics.holding import FAR
from sim.facts.metrics.score import Score
from sim.mission.recording import Recording, find_last_frames
from sim.world.contacts import KINDS
from tracking.metrics.ospa import ospa
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.track import Track, beliefs_of

# Sources of squared GOSPA, from the fleet's knowledge of the people behind it.
SOURCES = {
    "not_found_yet": "missed people whom no UAV has held so far",
    "known_to_others": "missed people whom another UAV holds or detects",
    "unknown_to_others": "missed people held before, whom no other UAV holds or detects now",
    "localisation": "errors of paired tracks",
    "false": "false tracks",
}


def average_ospa(ospa: Array) -> Array:
    """Mean (K, 3) m of OSPA and its parts (K, n, 3) m over the working UAVs; NaN at scans without any."""
    count = np.sum(~np.isnan(ospa), axis=1)
    mean = np.full(count.shape, np.nan)
    np.divide(np.nansum(ospa, axis=1), count, out=mean, where=count > 0)
    return mean


def list_contacts(recording: Recording) -> list[dict[str, Any]]:
    """Contacts, each with UAV, touched body, and times [s] of first and last scan; a lasting contact counts once."""
    found: list[dict[str, Any]] = []
    open_: dict[tuple[int, ...], tuple[int, dict[str, Any]]] = {}
    for k, *pair in recording.contacts.tolist():
        time, (uav, kind, other) = float(recording.times[k]), pair
        last, entry = open_.get(tuple(pair), (-2, {}))
        if last < k - 1:
            entry = {"time": time, "until": time, "uav": uav, "kind": KINDS[kind], "other": other}
            found.append(entry)
        entry["until"] = time
        open_[tuple(pair)] = (k, entry)
    return found


def count_bytes_sent(recording: Recording) -> Indices | None:
    """Bytes (N,) of messages per scan and working UAV; None if none works."""
    return _select_counted(recording.bytes_sent, recording.working)


def count_plan_bytes(recording: Recording) -> Indices | None:
    """Bytes (N,) of plans per decision and working UAV; None if none decided."""
    decides = np.isin(recording.times, recording.plan_times)
    return _select_counted(recording.plan_bytes, recording.working & decides[:, None])


def count_map_bytes(recording: Recording) -> Indices | None:
    """Bytes (K, n) of maps of trees by scan and UAV; None if no UAV could send any."""
    sent = recording.map_bytes
    return sent if sent is not None and sent.any() else None


def _select_counted(sent: Indices, counted: Flags) -> Indices | None:
    return sent[counted] if counted.any() else None


def measure_disagreement(held: Sequence[Sequence[Track]]) -> float:
    """Mean over all pairs of UAVs of the OSPA distance [m] between their track positions; 0 for fewer than two UAVs.

    held: tracks of each UAV.
    """
    places = [beliefs_of(tracks).means[:, :2] for tracks in held]
    gaps = [ospa(one, other).distance for one, other in combinations(places, 2)]
    return float(np.mean(gaps)) if gaps else 0.0


class Handoff(NamedTuple):
    """A person who passes from one UAV to another."""

    scan: int
    last: int  # last scan at which the first UAV's latest frame showed the person
    person: int
    uavs: tuple[int, int]  # from, to


def find_handoffs(recording: Recording) -> list[Handoff]:
    """Hand-offs, by person and scan.

    A person is with the UAV that detects them until its last frame shows them no more and another UAV detects them: of
    several the one that has done so for longest, then the first. Where views overlap, a missed detection counts, too.
    """
    frames = find_last_frames(recording.frames_taken)
    detected = np.take_along_axis(recording.matched, frames[:, :, None], axis=0) & recording.working[:, :, None]
    found = []
    for person, seen in enumerate(np.moveaxis(detected, 2, 0)):
        changes = np.diff(seen, axis=0, prepend=np.zeros_like(seen[:1]))
        since = np.zeros(seen.shape[1], dtype=np.int64)
        owner = -1
        last = 0
        for k in np.flatnonzero(changes.any(axis=1)).tolist():
            since[changes[k] & seen[k]] = k
            last = k - 1 if owner >= 0 and seen[k - 1, owner] else last
            uavs = np.flatnonzero(seen[k])
            if len(uavs) and owner not in uavs:
                before, owner = owner, int(uavs[since[uavs].argmin()])
                found += [Handoff(k, last, person, (before, owner))] if before >= 0 else []
    return found


def find_error_sources(recording: Recording, scores: Sequence[Score]) -> Array:
    """Parts (K, 5) m² of squared GOSPA, by `SOURCES`, for each pair of a scan and a UAV that works then."""
    frames = find_last_frames(recording.frames_taken)
    known = np.take_along_axis(recording.matched, frames[:, :, None], axis=0)  # (K, n, M), in last frames
    held = np.zeros_like(known)
    for i, score in enumerate(scores):
        held[recording.working[:, i], i] = score.held
    found = np.maximum.accumulate(held.any(axis=1), axis=0)
    known |= held
    parts = []
    for i, score in enumerate(scores):
        on = recording.working[:, i]
        missed = score.present & np.isnan(score.squared_errors)
        others = np.asarray(np.delete(known, i, axis=1).any(axis=1))[on]
        people = (missed & ~found[on], missed & found[on] & others, missed & found[on] & ~others)
        errors = np.nansum(score.squared_errors, axis=1), np.square(score.gospa[:, 3])
        parts.append(np.column_stack([*(FAR**2 / 2 * each.sum(axis=1) for each in people), *errors]))
    return np.concatenate(parts)


def measure_times_to_find(recording: Recording, scores: Sequence[Score]) -> Array:
    """Time [s] from the first scan at which each person is present and under no canopy until a UAV holds them.

    It is 0 for people found before that scan. Times of people never found end when they leave or the mission ends, so
    the mean is too small if many are missed. People that are always under canopies are left out.
    """
    times = recording.times
    there = recording.present
    held = np.zeros_like(there)
    for uav, score in enumerate(scores):
        held[recording.working[:, uav]] |= score.held
    open_to_view, found = find_people_in_the_open(recording.people, recording.trees), []
    for person in np.flatnonzero(open_to_view.any(axis=0)).tolist():
        appears = int(np.argmax(open_to_view[:, person]))
        scans = np.flatnonzero(held[:, person])
        end = scans[0] if len(scans) else np.flatnonzero(there[:, person])[-1]
        found.append(max(times[end] - times[appears], 0.0))
    return np.array(found)


def find_people_in_the_open(people: Array, trees: Array) -> Flags:
    """Mask (K, M) of people (K, M, 2) m, NaN if absent, under no canopy; trees (T, 6 or 7) as recorded."""
    free = ~np.isnan(people[..., 0])
    rows = np.flatnonzero(free)
    if len(rows) and len(trees):
        for covered in cKDTree(people[free]).query_ball_point(trees[:, :2], trees[:, 2]):
            free.flat[rows[covered]] = False
    return free
