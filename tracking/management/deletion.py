"""Track deletion: misses among the last scans, and tracks that share one person."""

from __future__ import annotations

import numpy as np

from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.distances import pair_distances

_ONE = 1.5  # sum of two existence probabilities below which they are rather of one person than of two


def counted_misses(misses: Indices, times: Array, now: float, window: int) -> Indices:
    """Bits (T,) of the misses with the scan at `now` counted, once the fleet agrees on the times (T, 3).

    A scan is a hit if any UAV detected the person, and a miss if none did although one had the person in view.
    Otherwise it does not count.
    """
    seen, expected, _ = (times >= now).T
    shifted = ((misses << 1) | ~seen) & ((1 << window) - 1)
    return np.where(seen | expected, shifted, misses)


def missed(misses: Indices, m: int) -> Flags:
    """Flags (T,) of tracks with m misses among the last scans."""
    return np.array([bin(bits).count("1") >= m for bits in misses.tolist()], dtype=np.bool_)


def shared_people(means: Array, covariances: Array, existence: Array, gate: float) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, of tracks that are of one person between them.

    means (T, 4), covariances (T, 4, 4), existence (T,); gate is the squared distance allowed. Where two tracks compete
    for one person's measurements, their probabilities of existence add up to one. One track with the sum of them, and
    none, is the multi-Bernoulli density nearest to this. Source: [Williams15].
    """
    if np.sort(existence)[:2].sum() >= _ONE or len(existence) < 2:
        return []
    near = np.triu(existence[:, None] + existence < _ONE, 1)
    rows = np.flatnonzero(near.any(axis=0) | near.any(axis=1))
    distance, _ = pair_distances(*[(means[rows], covariances[rows])] * 2)
    return [(int(rows[a]), int(rows[b])) for a, b in np.argwhere(near[np.ix_(rows, rows)] & (distance <= gate))]
