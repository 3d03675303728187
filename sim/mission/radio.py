"""What a network's settings come to: who hears whom, which messages are lost, and how far beliefs differ."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.scenario.network import Link, Network
from tracking.metrics.ospa import ospa
from tracking.numerics.compiled import Array
from tracking.numerics.matrices import length
from tracking.tracker import Track

Bools = NDArray[np.bool_]


class Links(NamedTuple):
    """Who talks to whom in one scan."""

    up: Bools  # (n, n) who hears whom, but for losses
    lost: Bools | None  # (L, n, n) which messages of consensus are lost; None: none is

    @property
    def touch(self) -> Bools:
        """Who hears of whom in this scan (n, n), be it in one round of consensus."""
        if self.lost is None or len(self.lost) == 0:
            return self.up
        return np.asarray(self.up & ~np.all(self.lost, axis=0))


def hearing(network: Network, time: float, positions: Array) -> Bools:
    """Who hears whom (n, n) of UAVs at positions (n, 3) m: those within range whose link exists and is not cut."""
    gap = length(positions[:, None] - positions[None])
    heard = np.asarray((gap <= network.range) & ~np.eye(len(gap), dtype=np.bool_))
    if network.links:
        heard &= _adjacency(network.links, len(gap))
    for cut in network.cuts:
        if cut.start <= time and (cut.end is None or time < cut.end):
            heard &= ~_adjacency(cut.links, len(gap))
    return heard


def losses(network: Network, uavs: int, rng: np.random.Generator) -> Bools | None:
    """Which messages of one scan are lost (L, n, n), per round, hearer and speaker; None: nothing ever is.

    The same chance is used whatever the probability, so what is lost at a lower one is lost at a higher one too.
    """
    if network.loss == 0.0:
        return None
    return rng.random((network.rounds, uavs, uavs)) < network.loss


def disagreement(held: Sequence[Sequence[Track]]) -> float:
    """How far the tracks of UAVs differ: OSPA distance [m] between the positions held by two, mean over the pairs.

    `held` is what each UAV holds; of fewer than two, none disagrees.
    """
    places = [np.array([track.belief.mean[:2] for track in tracks]) for tracks in held]
    gaps = [ospa(one, other).distance for one, other in combinations(places, 2)]
    return float(np.mean(gaps)) if gaps else 0.0


def _adjacency(links: Sequence[Link], uavs: int) -> Bools:
    table = np.zeros((uavs, uavs), dtype=np.bool_)
    ends = np.array(links)
    table[ends[:, 0], ends[:, 1]] = table[ends[:, 1], ends[:, 0]] = True
    return table
