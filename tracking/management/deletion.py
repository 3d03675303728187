"""Track deletion: detection histories, misses among the last scans, and duplicate tracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import squared_distance


@dataclass(frozen=True, eq=False)
class DetectionHistory:
    """Times of the last detections of T tracks by the fleet, and the misses since then.

    UAVs take the maximum of the times in each round, so that after enough rounds all hold the same.
    """

    times: Array  # (T, 3) s: last detection; last measurement of its own; last scan in view
    misses: Indices  # (T,), bit k is set if the k-th last scan that counts was a miss
    shared: Indices  # (T,), detections since the last measurement of its own

    @staticmethod
    def at(time: float, count: int) -> DetectionHistory:
        """History of tracks that have just been detected."""
        return DetectionHistory(np.full((count, 3), time), np.zeros(count, np.int64), np.zeros(count, np.int64))

    def __getitem__(self, rows: Flags | Indices) -> DetectionHistory:
        """History of some of the tracks."""
        return DetectionHistory(self.times[rows], self.misses[rows], self.shared[rows])

    def __add__(self, other: DetectionHistory) -> DetectionHistory:
        """History of these and then other tracks."""
        return DetectionHistory(
            np.concatenate([self.times, other.times]),
            np.concatenate([self.misses, other.misses]),
            np.concatenate([self.shared, other.shared]),
        )

    def observed(self, now: float, seen: Flags, own: Flags, expected: Flags) -> DetectionHistory:
        """History with one UAV's scan: flags (T,) of tracks it saw, gave their own measurement, and had in view."""
        marks = np.column_stack([seen, own, expected])
        return DetectionHistory(np.where(marks, now, self.times), self.misses, self.shared)

    def counted(self, now: float, window: int) -> DetectionHistory:
        """History with the scan at `now` counted, once the fleet agrees on the times.

        A scan is a hit if any UAV detected the person, and a miss if none did although one had the person in view.
        Otherwise it does not count.
        """
        seen, own, expected = (self.times >= now).T
        shifted = ((self.misses << 1) | ~seen) & ((1 << window) - 1)
        misses = np.where(seen | expected, shifted, self.misses)
        shared = np.where(own, 0, self.shared + seen)
        return DetectionHistory(self.times, misses, shared)

    def suspected(self, suspects: Flags, double: int) -> DetectionHistory:
        """History with suspects (T,) one shared measurement short of the `double` ones that delete a duplicate.

        If there are two people, the next scan shows it: each gets a measurement of its own.
        """
        shared = np.where(suspects, np.maximum(self.shared, double - 1), self.shared)
        return DetectionHistory(self.times, self.misses, shared)

    def missed(self, m: int) -> Flags:
        """Flags (T,) of tracks with m misses among the last scans."""
        return np.array([bin(bits).count("1") >= m for bits in self.misses.tolist()], dtype=np.bool_)


@compiled
def own_measurements(beta: Array, least: float) -> Indices:
    """Index (T,) of the measurement that each track does not share, -1 for none.

    Tracks in order take their most probable measurement that is still free, if its probability in beta (T, N + 1)
    is at least `least`.
    """
    own = np.full(len(beta), -1, dtype=np.int64)
    taken = np.zeros(beta.shape[1], dtype=np.bool_)
    for i in range(len(beta)):
        best = 0.0
        for j in range(1, beta.shape[1]):
            if beta[i, j] > best and not taken[j]:
                own[i], best = j - 1, beta[i, j]
        if best >= least:
            taken[own[i] + 1] = True
        else:
            own[i] = -1
    return own


def duplicates(means: Array, covariances: Array, suspects: Flags, gate: float) -> Flags:
    """Flags (T,) of suspects that are statistically the same as a track before them.

    means (T, d), covariances (T, d, d) of position and velocity, or of position alone; suspects (T,); gate is the
    squared Mahalanobis distance allowed.
    """
    found = np.zeros(len(means), dtype=np.bool_)
    for i in np.flatnonzero(suspects).tolist():
        found[i] = bool(np.any(squared_distance(means[:i] - means[i], covariances[:i] + covariances[i]) <= gate))
    return found
