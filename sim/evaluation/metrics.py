"""What tracks are worth against the people of a recording, for each UAV and for the fleet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mission.snapshot import Bools, Ints
from sim.recording.recording import Recording
from tracking.metrics.clearmot import correspondence, fragmentations, switches
from tracking.metrics.gospa import gospa
from tracking.metrics.nees import nees, nees_interval
from tracking.metrics.ospa import ospa2
from tracking.numerics.compiled import Array

HELD = 1.0  # m, from a person to the nearest track that holds them
FAR = 10.0  # m, beyond which a track is nobody's: cut-off of GOSPA, and of the errors that NEES counts


@dataclass(frozen=True, eq=False)
class Held:
    """What one UAV believed at K scans: A tracks, NaN where they are not. A column is an id."""

    ids: Ints  # (A,) ascending
    means: Array  # (K, A, 4)
    covariances: Array  # (K, A, 4, 4)


@dataclass(frozen=True, eq=False)
class Score:
    """One UAV against the truth, over the K scans at which it works; M people."""

    ospa: Array  # (K,) m, distance
    gospa: Array  # (K, 4) m: distance, localisation, missed, false
    ospa2: float  # m; NaN without a scan
    held: Bools  # (K, M)
    present: Bools  # (K, M)
    switches: int
    fragmentations: int
    position_nees: Array  # (E,), a number for each scan and person with a track within `FAR` m
    state_nees: Array  # (E',), fewer by those whose velocity is not known


def held_by(recording: Recording, uav: int) -> Held:
    """The tracks of one UAV in the order of their ids, scan by scan."""
    scans, uavs = recording.poses.shape[:2]
    k, owner = np.divmod(np.repeat(np.arange(scans * uavs), np.diff(recording.track_offsets)), uavs)
    rows = owner == uav
    ids, columns = np.unique(recording.track_ids[rows], return_inverse=True)
    means = np.full((scans, len(ids), 4), np.nan)
    covariances = np.full((scans, len(ids), 4, 4), np.nan)
    means[k[rows], columns] = recording.track_means[rows]
    covariances[k[rows], columns] = recording.track_covariances[rows]
    return Held(ids, means, covariances)


def velocities(recording: Recording) -> Array:
    """True velocities (K, M, 2) m/s: central differences of positions, one-sided where somebody comes or goes."""
    positions, times = recording.people, recording.times
    steps = np.full((len(times) + 1, *positions.shape[1:]), np.nan)
    steps[1:-1] = np.diff(positions, axis=0) / np.diff(times)[:, None, None]
    before, after = steps[:-1], steps[1:]
    both = np.isnan(before), np.isnan(after)
    return np.where(both[0], after, np.where(both[1], before, (before + after) / 2))


def score(recording: Recording, uav: int) -> Score:
    """One UAV's tracks against the people."""
    on = recording.working[:, uav]
    believed, people = held_by(recording, uav), recording.people[on]
    tracks = believed.means[on, :, :2]
    near = correspondence(tracks, people, HELD)
    present = ~np.isnan(people[..., 0])
    parts = [gospa(t[~np.isnan(t[:, 0])], p[~np.isnan(p[:, 0])], FAR) for t, p in zip(tracks, people, strict=True)]
    truth = np.concatenate([people, velocities(recording)[on]], axis=2)
    far = correspondence(tracks, people, FAR)
    k, m = np.nonzero(far >= 0)
    errors = believed.means[on][k, far[k, m]] - truth[k, m]
    P = believed.covariances[on][k, far[k, m]]
    moving = ~np.isnan(errors[:, 2])  # whoever is there for a single scan has no velocity
    return Score(
        ospa=recording.ospa[on, uav, 0],
        gospa=np.array(parts, dtype=float).reshape(-1, 4),
        ospa2=ospa2(tracks, people).distance if len(people) else np.nan,
        held=near >= 0,
        present=present,
        switches=int(switches(near).sum()),
        fragmentations=int(fragmentations(near, present).sum()),
        position_nees=nees(errors[:, :2], P[:, :2, :2]),
        state_nees=nees(errors[moving], P[moving]),
    )


def metrics(recording: Recording) -> dict[str, Any]:
    """What `summary.json` holds beside OSPA: `gospa`, `ospa2_m`, `identity`, `nees`, `people_held` and `uavs`.

    The fleet's GOSPA is the mean over all pairs of a scan and a UAV that works then; OSPA(2), switches, fragmentations
    and NEES are means over the UAVs. Who breaks down counts until then. None stands where there was nothing to count.
    """
    scores = [score(recording, i) for i in range(recording.poses.shape[1])]
    flown = [s for s in scores if len(s.gospa)]
    parts = np.concatenate([s.gospa for s in scores])
    held, present = (np.sum([getattr(s, name).sum(axis=0) for s in scores], axis=0) for name in ("held", "present"))
    return {
        "gospa": {
            "cut_off_m": FAR,
            "mean_m": mean(parts[:, 0]),
            "localisation_m": mean(parts[:, 1]),
            "missed": mean(parts[:, 2] ** 2 / (FAR**2 / 2)),
            "false": mean(parts[:, 3] ** 2 / (FAR**2 / 2)),
        },
        "ospa2_m": mean([s.ospa2 for s in flown]),
        "identity": {
            "within_m": HELD,
            "switches": mean([s.switches for s in flown]),
            "fragmentations": mean([s.fragmentations for s in flown]),
        },
        "nees": {
            "within_m": FAR,
            "position": _consistency([s.position_nees for s in flown], 2),
            "state": _consistency([s.state_nees for s in flown], 4),
        },
        "people_held": [float(h) / float(p) if p else None for h, p in zip(held, present, strict=True)],
        "share_held": mean(np.concatenate([s.held[s.present] for s in scores])),
        "uavs": [_row(s) for s in scores],
    }


def mean(values: ArrayLike) -> float | None:
    """The mean, or None where there is nothing."""
    array = np.asarray(values, dtype=float)
    return float(array.mean()) if array.size else None


def _consistency(errors: Sequence[Array], dof: int) -> dict[str, Any]:
    """Mean NEES of the UAVs, and where it is expected with 95 % if as many errors as one UAV has were independent.

    UAVs that share all they see make the same errors, so the fleet has no more of them than one UAV.
    """
    counted = [e for e in errors if len(e)]
    if not counted:
        return {"mean": None, "interval_95": None, "errors": 0}
    count = round(float(np.mean([len(e) for e in counted])))
    average = float(np.mean([e.mean() for e in counted]))
    return {"mean": average, "interval_95": list(nees_interval(count, dof)), "errors": count}


def _row(score: Score) -> dict[str, Any]:
    return {
        "ospa_m": mean(score.ospa),
        "gospa_m": mean(score.gospa[:, 0]),
        "ospa2_m": mean([score.ospa2] * (len(score.gospa) > 0)),
        "switches": score.switches,
        "fragmentations": score.fragmentations,
        "position_nees": mean(score.position_nees),
        "state_nees": mean(score.state_nees),
        "share_held": mean(score.held[score.present]),
    }
