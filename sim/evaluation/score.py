"""Score of each UAV: its tracks compared with the people of a recording, scan by scan."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim.recording.recording import Recording
from tracking.metrics.clearmot import correspondence, fragmentations, switches
from tracking.metrics.gospa import gospa
from tracking.metrics.ospa import ospa2
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.assignment import pairs_within
from tracking.numerics.distances import squared_distance

HELD = 1.0  # m, largest distance from a person to a track that holds them
FAR = 10.0  # m, distance beyond which a track belongs to no person: cut-off of GOSPA and of the errors in NEES


@dataclass(frozen=True, eq=False)
class Held:
    """Tracks that one UAV reports at K scans, with a column for each of A track ids."""

    ids: Indices  # (A,) ascending
    means: Array  # (K, A, 4), NaN if the track is not reported
    rows: Indices  # (K, A) rows in the recording's tables of tracks, -1 if the track is not reported


@dataclass(frozen=True, eq=False)
class Score:
    """One UAV compared with the truth of M people, over the K scans at which it works."""

    ospa: Array  # (K,) m, OSPA distance
    gospa: Array  # (K, 4) m: distance, localisation, missed, false
    ospa2: float  # m; NaN without a scan
    held: Flags  # (K, M)
    present: Flags  # (K, M)
    switches: int
    fragmentations: int
    position_nees: Array  # (E,), one for each pair of a track and a person
    state_nees: Array  # (E',), only pairs with a known velocity of the person


def find_reported_tracks(recording: Recording, uav: int) -> Held:
    """The tracks that one UAV reports, scan by scan."""
    k, owner = recording.cells(recording.track_offsets)
    rows, scans = (owner == uav) & recording.reported, len(recording.times)
    ids, columns = np.unique(recording.track_ids[rows], return_inverse=True)
    means = np.full((scans, len(ids), 4), np.nan)
    found = np.full((scans, len(ids)), -1)
    means[k[rows], columns] = recording.track_means[rows]
    found[k[rows], columns] = np.flatnonzero(rows)
    return Held(ids, means, found)


def velocities(recording: Recording) -> Array:
    """True velocities (K, M, 2) m/s: central differences of positions, one-sided when a person comes or goes."""
    positions, times = recording.people, recording.times
    steps = np.full((len(times) + 1, *positions.shape[1:]), np.nan)
    steps[1:-1] = np.diff(positions, axis=0) / np.diff(times)[:, None, None]
    before, after = steps[:-1], steps[1:]
    both = np.isnan(before), np.isnan(after)
    return np.where(both[0], after, np.where(both[1], before, (before + after) / 2))


class _Pairs(NamedTuple):
    """Pairs of a track and a person at a scan, as indices (E,)."""

    scans: Indices
    tracks: Indices
    people: Indices


def _pair_tracks(tracks: Array, people: Array, near: Indices) -> _Pairs:
    """The pairs that NEES counts; tracks (K, A, 2) m, people (K, M, 2) m.

    near (K, M): tracks that hold people, -1 for none. These are pairs, even if GOSPA's sum were smaller otherwise; all
    other tracks are paired as in GOSPA, scan by scan. Labels do not matter, because two exchanged tracks may still be
    consistent.
    """
    pairs: list[tuple[int, int, int]] = []
    for scan, (at, truth, held) in enumerate(zip(tracks, people, near, strict=True)):
        squares = np.square(at[:, None] - truth).sum(axis=2)
        taken = np.flatnonzero(held >= 0)
        pairs += [(scan, int(held[m]), int(m)) for m in taken]
        squares[held[taken]] = squares[:, taken] = np.inf
        pairs += [(scan, a, m) for a, m in pairs_within(squares, FAR * FAR) if squares[a, m] < FAR * FAR]
    return _Pairs(*np.array(pairs, dtype=np.int64).reshape(-1, 3).T)


def score(recording: Recording, uav: int) -> Score:
    """Compare one UAV's tracks with the people."""
    on = recording.working[:, uav]
    believed, people = find_reported_tracks(recording, uav), recording.people[on]
    tracks = believed.means[on, :, :2]
    near = correspondence(tracks, people, HELD)
    present = ~np.isnan(people[..., 0])
    parts = [gospa(t[~np.isnan(t[:, 0])], p[~np.isnan(p[:, 0])], FAR) for t, p in zip(tracks, people, strict=True)]
    truth = np.concatenate([people, velocities(recording)[on]], axis=2)
    k, column, m = _pair_tracks(tracks, people, near)
    errors = believed.means[on][k, column] - truth[k, m]
    P = recording.track_covariances[believed.rows[on][k, column]]
    moving = ~np.isnan(errors[:, 2])  # a person present for a single scan has no velocity
    return Score(
        ospa=recording.ospa[on, uav, 0],
        gospa=np.array(parts, dtype=float).reshape(-1, 4),
        ospa2=ospa2(tracks, people).distance if len(people) else np.nan,
        held=near >= 0,
        present=present,
        switches=int(switches(near).sum()),
        fragmentations=int(fragmentations(near, present).sum()),
        position_nees=squared_distance(errors[:, :2], P[:, :2, :2]),
        state_nees=squared_distance(errors[moving], P[moving]),
    )
