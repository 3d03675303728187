"""Measures of a whole fleet: mean OSPA, contacts, bytes sent, and disagreement about tracks."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np

from sim.mission.recording import Recording
from sim.world.contacts import KINDS
from tracking.metrics.ospa import ospa
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.track import Track, beliefs_of


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


def _select_counted(sent: Indices, counted: Flags) -> Indices | None:
    return sent[counted] if counted.any() else None


def measure_disagreement(held: Sequence[Sequence[Track]]) -> float:
    """Mean over all pairs of UAVs of the OSPA distance [m] between their track positions; 0 for fewer than two UAVs.

    held: tracks of each UAV.
    """
    places = [beliefs_of(tracks).means[:, :2] for tracks in held]
    gaps = [ospa(one, other).distance for one, other in combinations(places, 2)]
    return float(np.mean(gaps)) if gaps else 0.0
