"""Disagreement of UAVs on the tracks they hold."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from tracking.metrics.ospa import ospa
from tracking.tracker import Track


def disagreement(held: Sequence[Sequence[Track]]) -> float:
    """OSPA distance [m] between the track positions of two UAVs, mean over all pairs; 0 for fewer than two.

    held: tracks of each UAV.
    """
    places = [np.array([track.belief.mean[:2] for track in tracks]) for tracks in held]
    gaps = [ospa(one, other).distance for one, other in combinations(places, 2)]
    return float(np.mean(gaps)) if gaps else 0.0
