"""Radio links between UAVs, and lost messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.scenario.network import Link, Network
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length

Bools = NDArray[np.bool_]


class Links(NamedTuple):
    """Links between UAVs in one scan."""

    up: Bools  # (n, n) True where a row's UAV receives from a column's, unless lost
    lost: Bools | None  # (L, n, n) lost messages of consensus; None: none

    @property
    def contact(self) -> Bools:
        """Pairs (n, n) with at least one received message of consensus in this scan."""
        if self.lost is None or len(self.lost) == 0:
            return self.up
        return np.asarray(self.up & ~np.all(self.lost, axis=0))


def open_links(network: Network, time: float, positions: Array) -> Bools:
    """Adjacency (n, n) of UAVs at positions (n, 3) m: within range, with a link that exists and is not cut."""
    gap = length(positions[:, None] - positions[None])
    heard = np.asarray((gap <= network.range) & ~np.eye(len(gap), dtype=np.bool_))
    if network.links:
        heard &= _adjacency(network.links, len(gap))
    for cut in network.cuts:
        if cut.start <= time and (cut.end is None or time < cut.end):
            heard &= ~_adjacency(cut.links, len(gap))
    return heard


def lost_messages(network: Network, uavs: int, rng: np.random.Generator) -> Bools | None:
    """Lost messages of one scan (L, n, n), per round, receiver and sender; None if the network loses none.

    The random numbers do not depend on the probability, so a higher one loses the same messages and more.
    """
    if network.loss == 0.0:
        return None
    return rng.random((network.rounds, uavs, uavs)) < network.loss


def _adjacency(links: Sequence[Link], uavs: int) -> Bools:
    table = np.zeros((uavs, uavs), dtype=np.bool_)
    ends = np.array(links)
    table[ends[:, 0], ends[:, 1]] = table[ends[:, 1], ends[:, 0]] = True
    return table
