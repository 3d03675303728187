"""Scans of a recording that a user names by time."""

import numpy as np

from sim.mission.recording import Recording
from tracking.errors import InputError

_SLACK = 1e-6  # s, tolerance for typed times


def find_scans(
    recording: Recording, start: float, end: float | None, uav: int | None = None, *, name: str = "--time"
) -> list[int]:
    """Scans from `start` to `end` s, or only the one nearest to `start`.

    `name`: the option that error messages name. InputError if a time is not in the recording, or the UAV, if given,
    had broken down at one of the scans.
    """
    times, last = recording.times, float(recording.times[-1])
    for time in (start, *([] if end is None else [end])):
        if not -_SLACK <= time <= last + _SLACK:
            raise InputError(f"{name}: {time:g} s is not in the recording; allowed are 0 to {last:g} s")
    found = [int(np.argmin(np.abs(times - start)))]
    if end is not None:
        found = np.flatnonzero((times >= start - _SLACK) & (times <= end + _SLACK)).tolist()
    if not found:
        near = ", ".join(f"{times[k]:g}" for k in sorted(np.argsort(np.abs(times - start))[:2].tolist()))
        raise InputError(f"{name}: no scan lies between {start:g} and {end:g} s; the nearest are at {near} s")
    works = recording.working[:, uav] if uav is not None else np.ones(len(times), dtype=np.bool_)
    if not works[found].all():
        until = f"its last scan is that at {times[works][-1]:g} s" if np.any(works) else "it never worked"
        time = float(times[next(k for k in found if not works[k])])
        raise InputError(f"{name}: at {time:g} s UAV {uav} had broken down; {until}")
    return found
