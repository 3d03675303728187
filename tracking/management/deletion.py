"""Track deletion: misses among the last scans, and tracks that share one person."""

import numpy as np

from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import squared_distance
from tracking.track import DETECTED_AT, EXPECTED_AT

# Sum of two tracks' probabilities, of existence or detection, below which both are of one person rather than of two.
_ONE = 1.5
_LIKELIER = 3.0  # ratio of two tracks' probabilities from which on the likelier track is kept, not the first


@compiled
def count_misses(misses: Indices, times: Array, now: float, window: int) -> Indices:
    """Misses (T,) in bits, with the scan at `now` s added, after the fleet has agreed on the times (T, 4).

    A scan is a hit if any UAV detected the person, and a miss if none did although one had the person in view.
    Otherwise it does not count.
    """
    counted = misses.copy()
    for t in range(len(misses)):
        seen, expected = times[t, DETECTED_AT] >= now, times[t, EXPECTED_AT] >= now
        if seen or expected:
            counted[t] = ((misses[t] << 1) | (0 if seen else 1)) & ((1 << window) - 1)
    return counted


@compiled
def find_outcompeted(gates: Indices, detected: Array) -> Flags:
    """Flags (T,) of tracks whose measurements more likely belong to another track; only the other track has the hit.

    gates (G, 2): pairs of a track and a measurement in its gate; detected (T,): probabilities that one of these is the
    person's. The probabilities of two tracks that compete for one measurement add up to one. The likelier track has the
    hit, or the first if both are about as likely.
    """
    inside = np.zeros((len(detected), gates[:, 1].max() + 1 if len(gates) else 0), dtype=np.bool_)
    for g in range(len(gates)):
        inside[gates[g, 0], gates[g, 1]] = True
    without = np.zeros(len(detected), dtype=np.bool_)
    for a in range(len(detected)):
        for b in range(a + 1, len(detected)):
            if detected[a] + detected[b] < _ONE and not (without[a] or without[b]) and np.any(inside[a] & inside[b]):
                without[a if detected[b] > _LIKELIER * detected[a] else b] = True
    return without


@compiled
def find_rivals(existence: Array, among: Flags) -> Indices:
    """Tracks that can be in a pair of `find_duplicates`: with the least likely one they add up to one person, not two.

    existence (T,) and among (T,) as there; unless there are two such tracks there is no pair.
    """
    least = np.inf
    for t in range(len(existence)):
        if among[t]:
            least = min(least, existence[t])
    rivals = among.copy()
    for t in range(len(existence)):
        rivals[t] &= existence[t] < _ONE - least
    return np.nonzero(rivals)[0]


def find_duplicates(beliefs: tuple[Array, Array], existence: Array, among: Flags, gate: float) -> list[tuple[int, int]]:
    """Pairs (kept, other) of tracks that share one person, the nearest pairs first; each track is in one pair at most.

    beliefs: means (T, 4) and covariances (T, 4, 4); existence (T,); among (T,): flags of the tracks to pair; gate:
    largest squared distance. The existence probabilities of two tracks that compete for one person's measurements add
    up to one. The likelier track is kept, or the first if both are about as likely.
    Note: this is ours; [Williams15] approximates by tracks in their order, and keeps both tracks of such a pair.
    """
    rows = find_rivals(existence, among)
    if len(rows) < 2:
        return []
    means, covariances = beliefs[0][rows], beliefs[1][rows]
    distance = squared_distance(means[:, None] - means, covariances[:, None] + covariances)
    near = np.triu((distance <= gate) & (existence[rows][:, None] + existence[rows] < _ONE), 1)
    pairs: list[tuple[int, int]] = []
    for a, b in sorted(np.argwhere(near).tolist(), key=lambda pair: distance[pair[0], pair[1]]):
        first, second = int(rows[a]), int(rows[b])
        if not any({first, second} & {*pair} for pair in pairs):
            likelier = existence[second] > _LIKELIER * existence[first]
            pairs.append((second, first) if likelier else (first, second))
    return pairs
