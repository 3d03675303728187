"""Search times of a fleet, counted from the appearance of a person in the open."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from sim.facts.metrics.score import Score
from sim.mission.recording import Recording
from tracking.numerics.arrays import Array, Flags


def measure_times_to_find(recording: Recording, scores: Sequence[Score]) -> Array:
    """Time [s] from the first scan at which each person is present and under no canopy until a UAV holds them.

    It is 0 for people found before that scan. Times of people never found end when they leave or the mission ends, so
    the mean is too small if many are missed. People that are always under canopies are left out.
    """
    times, there = recording.times, ~np.isnan(recording.people[..., 0])
    held = np.zeros_like(there)
    for uav, score in enumerate(scores):
        held[recording.working[:, uav]] |= score.held
    open_to_view, found = _find_people_in_the_open(recording.people, recording.trees), []
    for person in np.flatnonzero(open_to_view.any(axis=0)).tolist():
        appears = int(np.argmax(open_to_view[:, person]))
        scans = np.flatnonzero(held[:, person])
        end = scans[0] if len(scans) else np.flatnonzero(there[:, person])[-1]
        found.append(max(times[end] - times[appears], 0.0))
    return np.array(found)


def _find_people_in_the_open(people: Array, trees: Array) -> Flags:
    """Mask (K, M) of people (K, M, 2) m, NaN if absent, under no canopy; trees (T, 6 or 7) as recorded."""
    free = ~np.isnan(people[..., 0])
    rows = np.flatnonzero(free)
    if len(rows) and len(trees):
        for covered in cKDTree(people[free]).query_ball_point(trees[:, :2], trees[:, 2]):
            free.flat[rows[covered]] = False
    return free
