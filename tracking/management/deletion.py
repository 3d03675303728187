"""What speaks for and against tracks, and which of them it ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.numerics.compiled import Array, compiled
from tracking.numerics.matrices import squared_distance

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Evidence:
    """When the fleet last saw T tracks, and the scans since that count against them.

    The times travel between UAVs by maximum, so that after enough rounds all hold the same.
    """

    times: Array  # (T, 3) s; when somebody last: saw it; gave it a measurement of its own; should have seen it
    misses: Indices  # (T,), bit k is set if the k-th last scan that counts was a miss
    shared: Indices  # (T,), scans in which it was seen since it last had a measurement of its own

    @staticmethod
    def at(time: float, count: int) -> Evidence:
        """Of tracks that have just been seen."""
        return Evidence(np.full((count, 3), time), np.zeros(count, np.int64), np.zeros(count, np.int64))

    def __getitem__(self, rows: NDArray[np.bool_] | Indices) -> Evidence:
        """Of some of the tracks."""
        return Evidence(self.times[rows], self.misses[rows], self.shared[rows])

    def __add__(self, other: Evidence) -> Evidence:
        """Of these and then other tracks."""
        return Evidence(
            np.concatenate([self.times, other.times]),
            np.concatenate([self.misses, other.misses]),
            np.concatenate([self.shared, other.shared]),
        )

    def observed(
        self, now: float, seen: NDArray[np.bool_], own: NDArray[np.bool_], expected: NDArray[np.bool_]
    ) -> Evidence:
        """With one UAV's scan added: which tracks (T,) it saw, gave a measurement of their own, should have seen."""
        marks = np.column_stack([seen, own, expected])
        return Evidence(np.where(marks, now, self.times), self.misses, self.shared)

    def counted(self, now: float, window: int) -> Evidence:
        """With the scan at `now` counted, once the fleet agrees on the times.

        A scan is a miss if somebody should have seen the person and nobody did, a hit if somebody did, and counts
        neither way otherwise.
        """
        seen, own, expected = (self.times >= now).T
        shifted = ((self.misses << 1) | ~seen) & ((1 << window) - 1)
        misses = np.where(seen | expected, shifted, self.misses)
        shared = np.where(own, 0, self.shared + seen)
        return Evidence(self.times, misses, shared)

    def watched(self, suspects: NDArray[np.bool_], double: int) -> Evidence:
        """With suspects (T,) one scan short of the `double` scans of shared measurements after which doubles end.

        Where there are two people, one scan shows it: each gets a measurement.
        """
        shared = np.where(suspects, np.maximum(self.shared, double - 1), self.shared)
        return Evidence(self.times, self.misses, shared)

    def refuted(self, m: int) -> NDArray[np.bool_]:
        """Whether each track has m misses among the scans remembered (T,)."""
        return np.array([bin(bits).count("1") >= m for bits in self.misses.tolist()], dtype=np.bool_)


@compiled
def own_measurements(beta: Array, least: float) -> Indices:
    """For each track the measurement it does not share, -1 for none (T,).

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


def doubles(means: Array, covariances: Array, suspects: NDArray[np.bool_], gate: float) -> NDArray[np.bool_]:
    """Whether each suspect is statistically the same as a track before it (T,).

    means (T, d), covariances (T, d, d) of position and velocity, or of position alone; suspects (T,); gate is the
    squared Mahalanobis distance allowed.
    """
    found = np.zeros(len(means), dtype=np.bool_)
    for i in np.flatnonzero(suspects).tolist():
        found[i] = bool(np.any(squared_distance(means[:i] - means[i], covariances[:i] + covariances[i]) <= gate))
    return found
