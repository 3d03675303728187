"""Search times of a fleet, from the appearance of a person in the open."""

from collections.abc import Sequence

import numpy as np

from sim.evaluation.score import Score
from sim.recording.recording import Recording
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length


def times_to_find(recording: Recording, scores: Sequence[Score]) -> Array:
    """Time [s] from the first scan at which each person is there and under no canopy until a UAV holds them.

    0 for those found before. Of those never found it is the time until they leave or the mission ends, so that the
    mean is one over what the mission could show. People always under canopies are left out.
    """
    times, people, trees = recording.times, recording.people, recording.trees
    there = ~np.isnan(people[..., 0])
    covered = np.zeros_like(there)
    for x, y, radius in trees[:, :3].tolist():
        covered |= length(people - np.array([x, y])) <= radius
    held = np.zeros_like(there)
    for uav, score in enumerate(scores):
        held[recording.working[:, uav]] |= score.held
    found = []
    for person in np.flatnonzero((there & ~covered).any(axis=0)).tolist():
        seen = int(np.argmax(there[:, person] & ~covered[:, person]))
        ends = np.flatnonzero(held[:, person])
        end = ends[0] if len(ends) else np.flatnonzero(there[:, person])[-1]
        found.append(max(times[end] - times[seen], 0.0))
    return np.array(found)
