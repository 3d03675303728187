"""Track deletion: misses among the last scans, and tracks that share one person."""

import numpy as np

from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import squared_distance

# Sum of two probabilities, of existence or of a detection, below which they are rather of one person than of two.
_ONE = 1.5
_LIKELIER = 3.0  # ratio of two probabilities from which on the larger decides which track is kept


@compiled
def counted_misses(misses: Indices, times: Array, now: float, window: int) -> Indices:
    """Bits (T,) of the misses with the scan at `now` counted, once the fleet agrees on the times (T, 4).

    A scan is a hit if any UAV detected the person, and a miss if none did although one had the person in view.
    Otherwise it does not count.
    """
    counted = misses.copy()
    for t in range(len(misses)):
        seen, expected = times[t, 0] >= now, times[t, 1] >= now
        if seen or expected:
            counted[t] = ((misses[t] << 1) | (0 if seen else 1)) & ((1 << window) - 1)
    return counted


@compiled
def without_measurement(gates: Indices, detected: Array) -> Flags:
    """Flags (T,) of tracks whose measurements are rather those of another track, which counts the hit.

    gates (G, 2): pairs of a track and a measurement in its gate; detected (T,): probabilities that one of them is the
    person's. Those of two tracks that compete for one measurement add up to one: the first has it if they are about
    as likely, else the likelier.
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


def shared_people(beliefs: tuple[Array, Array], existence: Array, among: Flags, gate: float) -> list[tuple[int, int]]:
    """Pairs (kept, other) of tracks that are of one person between them, the nearest pairs first, each track in one.

    beliefs: means (T, 4) and covariances (T, 4, 4); existence (T,); among (T,): flags of those that may be; gate: the
    squared distance allowed. Probabilities of existence of two tracks that compete for one person's measurements add up
    to one. The first is kept of two that are about as likely, else the likelier.
    Note: this is ours; [Williams15] approximates by tracks in their order, and lets two halves be.
    """
    # Those that with the least likely one add up to less than one person.
    rows = np.flatnonzero(among & (existence < _ONE - existence[among].min(initial=np.inf)))
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
