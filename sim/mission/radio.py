"""The radio: links between UAVs in one scan, and the messages that they lose."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim.scenario.uavs import Network, UavPair
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.distances import length


class RadioLinks(NamedTuple):
    """Links between UAVs in one scan."""

    up: Flags  # (n, n) True where the row's UAV receives from the column's, unless the message is lost
    lost: Flags | None  # (L, n, n) lost messages of consensus per round; None if the network loses none

    @property
    def contact(self) -> Flags:
        """Pairs (n, n) with at least one received message of consensus in this scan."""
        if self.lost is None or len(self.lost) == 0:
            return self.up
        return np.asarray(self.up & ~np.all(self.lost, axis=0))

    def among(self, uavs: Sequence[int]) -> "RadioLinks":
        """Links between some of the UAVs."""
        lost = None if self.lost is None else self.lost[:, uavs][:, :, uavs]
        return RadioLinks(self.up[np.ix_(uavs, uavs)], lost)


def find_links(network: Network, time: float, positions: Array) -> Flags:
    """Adjacency (n, n) of UAVs at positions (n, 3) m: within range, with a link that exists and is not cut."""
    gap = length(positions[:, None] - positions[None])
    heard = np.asarray((gap <= network.range) & ~np.eye(len(gap), dtype=np.bool_))
    if network.links:
        heard &= _make_adjacency(network.links, len(gap))
    for cut in network.cuts:
        if cut.start <= time and (cut.end is None or time < cut.end):
            heard &= ~_make_adjacency(cut.links, len(gap))
    return heard


def draw_lost_messages(network: Network, uavs: int, rng: np.random.Generator) -> Flags | None:
    """Mask (L, n, n) of one scan's lost messages, by round, receiver and sender; None if the network loses none.

    The random numbers do not depend on the probability: with a higher one the same messages are lost, and more.
    """
    if network.loss == 0.0:
        return None
    return rng.random((network.rounds, uavs, uavs)) < network.loss


def _make_adjacency(links: Sequence[UavPair], uavs: int) -> Flags:
    table = np.zeros((uavs, uavs), dtype=np.bool_)
    ends = np.array(links)
    table[ends[:, 0], ends[:, 1]] = table[ends[:, 1], ends[:, 0]] = True
    return table
