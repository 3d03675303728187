"""Likeliest pairs of tracks of two UAVs, by beliefs and labels."""

from __future__ import annotations

import numpy as np

from tracking.numerics.arrays import Array, Flags
from tracking.numerics.assignment import most_pairs
from tracking.numerics.distances import pair_distances


def match_beliefs(ours: tuple[Array, Array], theirs: tuple[Array, Array], gate: float) -> list[tuple[int, int]]:
    """Likeliest pairs of beliefs (A, 4), (A, 4, 4) and (B, 4), (B, 4, 4) in squared distance up to `gate`."""
    distance, cost = pair_distances(ours, theirs)
    return most_pairs(distance <= gate, cost)


def crossed_labels(common: Flags, near: Flags) -> Flags:
    """Flags (A, B) of near pairs with the labels of two other tracks that are near to each other, too.

    Labels have crossed if not both pairs of a common label are near. common, near (A, B): flags of pairs with a common
    label, and of pairs with beliefs that agree.
    """
    out = np.zeros_like(common)
    for a, b in np.argwhere(near & ~common).tolist():
        for k, j in np.argwhere(common[:, b][:, None] & common[a][None] & near).tolist():
            out[a, b] |= not (near[a, j] and near[k, b])
    return out
