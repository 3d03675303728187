"""Hand-offs: people whom one UAV detected last, and another detects now."""

from typing import NamedTuple

import numpy as np

from sim.mission.recording import Recording, find_last_frames


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
        since, owner, last = np.zeros(seen.shape[1], dtype=np.int64), -1, 0
        for k in np.flatnonzero(changes.any(axis=1)).tolist():
            since[changes[k] & seen[k]] = k
            last = k - 1 if owner >= 0 and seen[k - 1, owner] else last
            uavs = np.flatnonzero(seen[k])
            if len(uavs) and owner not in uavs:
                before, owner = owner, int(uavs[since[uavs].argmin()])
                found += [Handoff(k, last, person, (before, owner))] if before >= 0 else []
    return found
