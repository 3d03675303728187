"""Tracks that stand for no person: false tracks and duplicates, for metrics and for events."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim.facts.metrics.holding import FAR, find_episodes, find_holding
from sim.facts.metrics.score import ReportedTracks, find_reported_tracks
from sim.mission.recording import Recording
from tracking.metrics.clearmot import find_correspondence
from tracking.numerics.arrays import Array, Flags, Indices


@dataclass(frozen=True, eq=False)
class Unmatched:
    """A track that stands for no person from a first to a last scan, both included."""

    id: int
    first: int
    last: int
    nearest: int | None  # person with the least median distance over these scans
    gap: float  # m, that median distance; infinite without people
    duplicate: bool  # True if this holds the nearest person: it is their second track; False for a false track
    alone: Flags  # (last - first + 1, n), UAVs for which the track stands for no person
    left: int | None  # the track's last person, if they have left the area
    since: int  # first scan at which a UAV has a track of this id, reported or not


def find_unmatched_tracks(recording: Recording) -> Iterator[Unmatched]:
    """Tracks that stand for no person and cannot be paired, within `FAR` m as in GOSPA, with a person without one.

    A track within `loss_distance` of a person with another track is a duplicate; others are false tracks. There are
    none if people are unknown.
    """
    if not recording.labelled:
        return
    people, working, standing = recording.people, recording.working, find_holding(recording).tracks
    rows = recording.cells(recording.track_offsets)[0]  # scan of each row, in ascending order
    alone: defaultdict[int, Flags] = defaultdict(lambda: np.zeros(working.shape, dtype=np.bool_))
    places: defaultdict[int, Array] = defaultdict(lambda: np.full((*working.shape, 2), np.nan))
    for i in range(recording.uav_count):
        reported = find_reported_tracks(recording, i)
        free = _find_unmatched(reported, standing[:, i], people) & working[:, i, None]
        for column in np.flatnonzero(free.any(axis=0)).tolist():
            id_ = int(reported.ids[column])
            alone[id_][:, i] = free[:, column]
            places[id_][:, i] = reported.means[:, column, :2]
    for id_, table in alone.items():
        # UAVs may differ about the position: it is taken from the first UAV for which the track stands for no person.
        place = places[id_][np.arange(len(table)), table.argmax(axis=1)]
        gaps = np.hypot(*np.moveaxis(people - place[:, None], 2, 0))  # (K, M) m
        gaps[np.isnan(gaps)] = np.inf
        for first, last, value in find_episodes(np.asarray(table.any(axis=1), dtype=np.int64)):
            if value:
                span = slice(first, last + 1)
                left = _find_person_who_left(standing[:first] == id_, recording.present[first])
                since = int(rows[np.argmax(recording.track_ids == id_)])
                nearest, gap = _find_nearest(gaps[span])
                duplicate = gap <= recording.setting.loss_distance
                yield Unmatched(id_, first, last, nearest, gap, duplicate, table[span], left, since)


def _find_unmatched(reported: ReportedTracks, standing: Indices, people: Array) -> Flags:
    """Mask (K, A) of one UAV's tracks that stand for no person, given the ids (K, M) of those that hold people."""
    stands = (reported.ids == standing[:, :, None]).any(axis=1)
    places = np.where(stands[:, :, None], np.nan, reported.means[:, :, :2])
    unheld = np.where((standing >= 0)[:, :, None], np.nan, people)
    free = ~np.isnan(places[:, :, 0])
    scans = np.flatnonzero(free.any(axis=1))  # scans without such a track do not affect the correspondence
    matched = find_correspondence(places[scans], unheld[scans], FAR)
    k, m = np.nonzero(matched >= 0)
    free[scans[k], matched[k, m]] = False
    return free


def _find_person_who_left(stood: Flags, present: Flags) -> int | None:
    """The last person for whom a track stood, given for whom it did (K, n, M), unless that person is present (M,)."""
    scans, people = np.nonzero(stood.any(axis=1))
    return int(people[-1]) if len(scans) and not present[people[-1]] else None


def _find_nearest(gaps: Array) -> tuple[int | None, float]:
    """The person with the least median of distances (K, M) m, and this median [m]."""
    median = np.median(gaps, axis=0)
    if not np.isfinite(median).any():
        return None, float("inf")
    return int(median.argmin()), float(median.min())
