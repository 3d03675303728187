"""Score of each UAV: its tracks compared with the people of a recording, scan by scan."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from sim.facts.metrics.holding import FAR, find_holding
from sim.mission.recording import Recording
from tracking.metrics.clearmot import Matcher, count_fragmentations, count_switches
from tracking.metrics.ospa import gospa, ospa2
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.assignment import most_pairs, pairs_within
from tracking.numerics.distances import length, squared_distance
from tracking.registration.pose_errors import move_to_believed

_TAKEN = 9.21  # largest squared distance of a track from a detection that it took: 99 % of chi-square, in its noise


@dataclass(frozen=True, eq=False)
class ReportedTracks:
    """Tracks that one UAV reports at K scans, with a column for each of A track ids."""

    ids: Indices  # (A,) ascending
    means: Array  # (K, A, 4), NaN if the track is not reported
    rows: Indices  # (K, A) rows in the recording's tables of tracks, -1 if the track is not reported


@dataclass(frozen=True, eq=False)
class Score:
    """One UAV compared with the truth of M people, over the K scans at which it works."""

    ospa: Array  # (K,) m, OSPA distance
    gospa: Array  # (K, 4) m: distance, localisation, missed, false
    squared_errors: Array  # (K, M) m², of the tracks that GOSPA pairs with people; NaN for missed and absent people
    ospa2: float  # m; NaN without a scan
    held: Flags  # (K, M)
    present: Flags  # (K, M)
    switches: int
    fragmentations: int
    position_nees: Array  # (E,), one for each pair of a track and the person it is of, see `_find_tracks_by_detections`
    state_nees: Array  # (E',), only pairs with a known velocity of the person
    left_out: int  # pairs of a scan and a reported track that NEES does not count


def find_reported_tracks(recording: Recording, uav: int) -> ReportedTracks:
    """The tracks that one UAV reports, scan by scan."""
    k, owner = recording.cells(recording.track_offsets)
    rows = (owner == uav) & recording.reported
    scans = recording.scan_count
    ids, columns = np.unique(recording.track_ids[rows], return_inverse=True)
    means = np.full((scans, len(ids), 4), np.nan)
    found = np.full((scans, len(ids)), -1)
    means[k[rows], columns] = recording.track_means[rows]
    found[k[rows], columns] = np.flatnonzero(rows)
    return ReportedTracks(ids, means, found)


def estimate_velocities(recording: Recording) -> Array:
    """True velocities (K, M, 2) m/s: central differences of positions, one-sided when a person comes or goes."""
    positions = recording.people
    times = recording.times
    steps = np.full((len(times) + 1, *positions.shape[1:]), np.nan)
    steps[1:-1] = np.diff(positions, axis=0) / np.diff(times)[:, None, None]
    before, after = steps[:-1], steps[1:]
    both = np.isnan(before), np.isnan(after)
    return np.where(both[0], after, np.where(both[1], before, (before + after) / 2))


def owners_of(measurements: Array, people: Array, detected: Indices) -> Indices:
    """Index (N,) of the person of each measurement (N, 2) m of one frame, -1 for a false alarm.

    people (M, 2) m; detected: indices of those whom the frame detected, each of them by the measurement nearest to
    them, all in all.
    """
    found = np.full(len(measurements), -1)
    squares = np.sum(np.square(measurements - people[detected][:, None]), axis=2)
    for m, j in most_pairs(np.isfinite(squares), squares):
        found[j] = detected[m]
    return found


@lru_cache(maxsize=1)  # because each UAV's score asks for the same
def _find_owners(recording: Recording) -> tuple[Indices, Array]:
    """Index (D,) of the person of each measurement, -1 for a false alarm, and the measurements from true poses."""
    found, places = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2))]
    for k, i in product(range(recording.scan_count), range(recording.uav_count)):
        owners, z = find_owners_at(recording, k, i)
        found.append(owners)
        places.append(z)
    return np.concatenate(found), np.concatenate(places)


def find_owners_at(recording: Recording, k: int, uav: int) -> tuple[Indices, Array]:
    """As `_find_owners`, of one UAV's measurements at scan k."""
    scan = recording.scan_at(k, uav)
    z = scan.measurements
    if recording.believed is not None:
        z = move_to_believed(z, scan.pose, recording.camera_at(k, uav))
    return owners_of(z, recording.people[k], np.flatnonzero(recording.matched[k, uav])), z


def _find_tracks_by_detections(recording: Recording, uav: int, believed: ReportedTracks) -> Indices:
    """Index (K, M) of the track that is of each person at each scan, -1 for none.

    It is the track that was updated by the person's last detection, by any UAV, and by no later one of somebody else.
    Which track a detection updated is decided as in CLEAR MOT, with distances in the detection's noise instead of
    distances from people. At the first scan tracks that hold a person were known. Detections that trackers correct by
    estimated errors of poses count where they are from the true pose, and in the noise of the track, too.
    """
    (owners, true), (_, uavs, people) = _find_owners(recording), recording.matched.shape
    tracks = believed.means[:, :, :2]
    estimates = recording.believed is not None and recording.setting.tracking.pose_errors == "estimate"
    taken_at = true if estimates else recording.measurements
    ends = recording.measurement_offsets[::uavs].tolist()
    matcher, holder = Matcher(people, 1.0), np.full(people, -1)
    known = np.where(believed.ids[:, None] == find_holding(recording).tracks[0, uav], 0.0, np.nan)
    found = np.empty(recording.present.shape, dtype=np.int64)
    for k, places in enumerate(tracks):
        rows = np.arange(*ends[k : k + 2])
        rows = rows[owners[rows] >= 0]
        gaps = places[:, None] - taken_at[rows]
        covariances = recording.measurement_covariances[rows]
        if estimates:
            covariances = covariances + recording.track_covariances[believed.rows[k], None, :2, :2]
        squares = np.full((len(places), people), np.nan)
        np.fmin.at(squares.T, owners[rows], squared_distance(gaps, covariances).T)
        for distances in (*([known] if k == 0 else []), np.sqrt(squares / _TAKEN)):
            taken = matcher.match(distances)
            holder[np.isin(holder, taken[taken >= 0])] = -1
            holder[taken >= 0] = taken[taken >= 0]
        found[k] = holder
    return found


def _find_squared_errors(tracks: Array, people: Array) -> Array:
    """Squared distances (M,) m² of people (M, 2) m from their tracks in GOSPA; NaN for those without one."""
    squares, found = np.square(length(tracks[:, None] - people)), np.full(len(people), np.nan)
    for t, m in pairs_within(np.where(np.isnan(squares), np.inf, squares), FAR**2):
        found[m] = squares[t, m]
    return found


def score(recording: Recording, uav: int) -> Score:
    """Compare one UAV's tracks with the people."""
    on = recording.working[:, uav]
    believed, people = find_reported_tracks(recording, uav), recording.people[on]
    tracks = believed.means[on, :, :2]
    near = find_holding(recording).tracks[on, uav]
    present = recording.present[on]
    reported = ~np.isnan(tracks[..., 0])
    parts = [gospa(t[~np.isnan(t[:, 0])], p[~np.isnan(p[:, 0])], FAR) for t, p in zip(tracks, people, strict=True)]
    truth = np.concatenate([people, estimate_velocities(recording)[on]], axis=2)
    holders = _find_tracks_by_detections(recording, uav, believed)[on]
    there = np.take_along_axis(np.pad(reported, ((0, 0), (0, 1))), holders, axis=1)  # the last column is for none
    k, m = np.nonzero(present & there)
    column = holders[k, m]
    errors = believed.means[on][k, column] - truth[k, m]
    P = recording.track_covariances[believed.rows[on][k, column]]
    moving = ~np.isnan(errors[:, 2])  # a person present for a single scan has no velocity
    return Score(
        ospa=recording.ospa[on, uav, 0],
        gospa=np.array(parts, dtype=float).reshape(-1, 4),
        squared_errors=np.array([_find_squared_errors(*pair) for pair in zip(tracks, people, strict=True)]).reshape(
            present.shape
        ),
        ospa2=ospa2(tracks, people).distance if len(people) else np.nan,
        held=near >= 0,
        present=present,
        switches=int(count_switches(near).sum()),
        fragmentations=int(count_fragmentations(near, present).sum()),
        position_nees=squared_distance(errors[:, :2], P[:, :2, :2]),
        state_nees=squared_distance(errors[moving], P[moving]),
        left_out=int(reported.sum()) - len(k),
    )
