"""Scans of a recording that a user asks for by time."""

from __future__ import annotations

import numpy as np

from sim.recording.recording import Recording
from sim.scenario.errors import InputError

_SLACK = 1e-6  # s, for times that were typed


def scans_between(recording: Recording, start: float, end: float | None) -> list[int]:
    """Scans from `start` to `end` s, or the one nearest to `start`; InputError if a time is not in the recording."""
    times, last = recording.times, float(recording.times[-1])
    for time in (start, *([] if end is None else [end])):
        if time > last + _SLACK:
            raise InputError(f"--time: {time:g} s is not in the recording; allowed are 0 to {last:g} s")
    if end is None:
        return [int(np.argmin(np.abs(times - start)))]
    found = np.flatnonzero((times >= start - _SLACK) & (times <= end + _SLACK)).tolist()
    if not found:
        near = ", ".join(f"{times[k]:g}" for k in sorted(np.argsort(np.abs(times - start))[:2].tolist()))
        raise InputError(f"--time: no scan lies between {start:g} and {end:g} s; the nearest are at {near} s")
    return found


def check_working(recording: Recording, scans: list[int], uav: int) -> None:
    """InputError if the UAV had broken down at one of the scans."""
    works = recording.working[:, uav]
    if not np.all(works[scans]):
        last = f"its last scan is that at {recording.times[works][-1]:g} s" if np.any(works) else "it never worked"
        time = recording.times[next(k for k in scans if not works[k])]
        raise InputError(f"--time: at {time:g} s UAV {uav} had broken down; {last}")
