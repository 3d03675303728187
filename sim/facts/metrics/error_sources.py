"""Sources of a fleet's error: squared GOSPA by what the fleet knew of the people behind it."""

from collections.abc import Sequence

import numpy as np

from sim.facts.metrics.holding import FAR
from sim.facts.metrics.score import Score
from sim.mission.recording import Recording, find_last_frames
from tracking.numerics.arrays import Array

# Missed people: no UAV has held them yet; another UAV holds or detects them; others. Squared distances of tracks from
# their people. False tracks.
SOURCES = ("not_found_yet", "known_to_others", "lost", "localisation", "false")


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
