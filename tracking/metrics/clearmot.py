"""CLEAR MOT: correspondence of tracks and people from scan to scan, identity switches and fragmentations."""

import numpy as np

from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.assignment import most_pairs


def find_correspondence(tracks: Array, people: Array, within: float) -> Indices:
    """Track (K, M) that corresponds to each of M people at each of K scans, as an index into A tracks; -1 for none.

    tracks (K, A, 2) m and people (K, M, 2) m, NaN where absent. A track may correspond to a person `within` m, and to
    one only at each scan. A person keeps the last track while it is near enough, also after scans without it. Of two
    people with the same last track, the one that had it later keeps it. The others are paired anew: as many pairs as
    possible, then as near as possible.
    Source: [Bernardin08], where a correspondence holds until another one contradicts it.
    Note: TrackEval and the MATLAB kit of MOTChallenge continue only correspondences of the scan before. All count a
    switch against the last track, however long ago.
    """
    X, Y = np.asarray(tracks, dtype=float), np.asarray(people, dtype=float)
    if X.ndim != 3 or Y.ndim != 3 or len(X) != len(Y):
        raise ValueError(f"tracks and people must be (K, A, 2) and (K, M, 2), are {X.shape} and {Y.shape}")
    matcher = Matcher(Y.shape[1], within)
    return np.array([matcher.step(x, y) for x, y in zip(X, Y, strict=True)], dtype=np.int64).reshape(Y.shape[:2])


class Matcher:
    """The result of `find_correspondence`, scan by scan; tracks may be added at each scan."""

    def __init__(self, people: int, within: float) -> None:
        if not within > 0:
            raise ValueError(f"within must be positive, is {within}")
        self._within = within
        self._last = np.full(people, -1)  # last track of each person
        self._since = np.full(people, -1)  # the scan at which the person had it last
        self._scan = 0

    def step(self, tracks: Array, people: Array) -> Indices:
        """The track of each person (M,) at the next scan; tracks (A, 2) m, those of earlier scans first."""
        x, y = tracks[:, :1] - people[:, 0], tracks[:, 1:] - people[:, 1]  # apart, which takes a third of the time
        return self.match(np.sqrt(x * x + y * y))

    def match(self, gaps: Array) -> Indices:
        """The same from distances (A, M) of any kind, NaN where there are none."""
        gap = np.where(gaps <= self._within, gaps, np.inf)  # absent or too far
        now, free = np.full(gap.shape[1], -1), np.ones(len(gap), dtype=np.bool_)
        # Give people the tracks that they had last, where these are near enough. People with the latest correspondence
        # come first; two people cannot have had a track at the same scan.
        held = np.flatnonzero(self._since >= 0)
        held = held[np.isfinite(gap[self._last[held], held])]
        for m in held[np.argsort(-self._since[held], kind="stable")].tolist():
            if free[self._last[m]]:
                now[m] = self._last[m]
                free[now[m]] = False
        # Pair people and tracks without a correspondence yet.
        left, without = np.flatnonzero(free), np.flatnonzero(now < 0)
        if len(left) and len(without):
            rest = gap[left[:, None], without]
            for k, m in most_pairs(np.isfinite(rest), rest):
                now[without[m]] = left[k]
        found = now >= 0
        self._last[found], self._since[found] = now[found], self._scan
        self._scan += 1
        return now


def count_switches(matches: Indices) -> Indices:
    """Number of changes of track of each of M people (M,), from the result of `find_correspondence`.

    Scans without a track between two tracks do not count. Source: [Bernardin08], mismatches.
    """
    return np.array([np.count_nonzero(np.diff(column[column >= 0])) for column in matches.T], dtype=np.int64)


def count_fragmentations(matches: Indices, present: Flags) -> Indices:
    """Number of interruptions of each of M people (M,): scans without a track between scans with one.

    matches (K, M) as `find_correspondence` gives them; present (K, M): scans without the person do not count.
    """
    held = [(matches[present[:, m], m] >= 0).astype(np.int64) for m in range(matches.shape[1])]
    rises = [np.count_nonzero(np.diff(h, prepend=0) == 1) for h in held]
    return np.array([max(0, count - 1) for count in rises], dtype=np.int64)
