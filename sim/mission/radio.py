"""The radio: links between UAVs in one scan, the messages that they lose, and those that take time."""

import heapq
from collections.abc import Iterator, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from sim.scenario.uavs import Network, UavPair
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.distances import length

Content = TypeVar("Content")
_ROUNDING = 1e-9  # s; a message that is this much late is on time


class RadioLinks(NamedTuple):
    """Links between UAVs in one scan."""

    up: Flags  # (n, n) True where the row's UAV receives from the column's, unless the message is lost
    # (L, n, n) lost messages by round; L is 1 in a network that takes time. None if the network loses none
    lost: Flags | None
    jitter: Array | None = None  # (n, n) s, delays of the scan's messages beyond `network.delay`; None: zeros

    @property
    def contact(self) -> Flags:
        """Pairs (n, n) with at least one message of this scan that is received, at once or later."""
        if self.lost is None or len(self.lost) == 0:
            return self.up
        return np.asarray(self.up & ~np.all(self.lost, axis=0))

    @property
    def first_round(self) -> Flags:
        """Pairs (n, n) whose message of the scan's first round is received, as those are that are sent once."""
        return self.up if self.lost is None or len(self.lost) == 0 else np.asarray(self.up & ~self.lost[0])

    def find_heard(self, uav: int, *, takes_time: bool) -> Flags:
        """UAVs (n,) whose present frames a UAV knows at a decision: its own, and those of UAVs in contact.

        In a network that takes time, nobody knows yet what others see now. This is the home of the rule.
        """
        heard = np.zeros(len(self.up), dtype=np.bool_) if takes_time else self.contact[uav].copy()
        heard[uav] = True
        return heard

    def among(self, uavs: Sequence[int]) -> "RadioLinks":
        """Links between some of the UAVs."""
        lost = None if self.lost is None else self.lost[:, uavs][:, :, uavs]
        return RadioLinks(self.up[np.ix_(uavs, uavs)], lost)


def draw_links(network: Network, time: float, positions: Array, rng: np.random.Generator) -> RadioLinks:
    """Links between UAVs at positions (n, 3) m in a scan at `time` s, with losses and jitter by chance."""
    up = find_links(network, time, positions)
    return RadioLinks(up, draw_lost_messages(network, len(up), rng), draw_jitter(network, len(up), rng))


def find_links(network: Network, time: float, positions: Array) -> Flags:
    """Adjacency (n, n) of UAVs at positions (n, 3) m: within range, with a link that exists and is not cut."""
    broken = np.logical_or.reduce(list(find_broken_links(network, time, positions).values()))
    np.fill_diagonal(broken, True)
    return np.asarray(~broken)


def find_broken_links(network: Network, time: float, positions: Array) -> dict[str, Flags]:
    """Masks (n, n) of the pairs of UAVs at positions (n, 3) m without a link, by the reasons that the network has."""
    gap, broken = length(positions[:, None] - positions[None]), dict[str, Flags]()
    if network.links:
        broken["not linked"] = ~_make_adjacency(network.links, len(gap))
    if network.cuts:
        broken["cut"] = np.zeros(gap.shape, dtype=np.bool_)
    for each in network.cuts:
        if each.start <= time and (each.end is None or time < each.end):
            broken["cut"] |= _make_adjacency(each.links, len(gap))
    return broken | {"out of range": gap > network.range}


def draw_lost_messages(network: Network, uavs: int, rng: np.random.Generator) -> Flags | None:
    """Mask (L, n, n) of one scan's lost messages, by round, receiver and sender; None if the network loses none.

    The random numbers do not depend on the probability: with a higher one the same messages are lost, and more.
    """
    if network.loss == 0.0:
        return None
    return rng.random((1 if network.takes_time else network.rounds, uavs, uavs)) < network.loss


def draw_jitter(network: Network, uavs: int, rng: np.random.Generator) -> Array | None:
    """Delays (n, n) s of messages beyond `network.delay`, by receiver and sender; None if there are none."""
    return network.jitter * rng.random((uavs, uavs)) if network.jitter else None


class Sender:
    """A UAV's transmitter, which sends one message after the other at `network.rate`."""

    def __init__(self, network: Network) -> None:
        self._rate = network.rate
        self._patience = network.longest_wait
        self._free = 0.0  # s, from when on nothing waits to be sent

    def send(self, time: float, size: int) -> float | None:
        """Send so many bytes, from `time` s on; return when they are sent [s].

        A message that would have to wait for longer than `network.hold` is dropped: None.
        """
        begin = max(time, self._free)
        if begin - time > self._patience:
            return None
        self._free = begin if self._rate is None else begin + size / self._rate
        return self._free


class Inbox(Generic[Content]):
    """Messages on their way to one UAV."""

    def __init__(self) -> None:
        self._coming: list[tuple[float, int, Content]] = []  # arrival [s], and number, which no two messages share
        self._count = 0

    def put(self, arrival: float, content: Content) -> None:
        """Put a message on its way, which arrives at a time [s]."""
        heapq.heappush(self._coming, (arrival, self._count, content))
        self._count += 1

    def take(self, time: float) -> Iterator[Content]:
        """Take out what has arrived by `time` s, in the order of arrival."""
        while self._coming and self._coming[0][0] <= time + _ROUNDING:
            yield heapq.heappop(self._coming)[2]


def _make_adjacency(links: Sequence[UavPair], uavs: int) -> Flags:
    table = np.zeros((uavs, uavs), dtype=np.bool_)
    ends = np.array(links)
    table[ends[:, 0], ends[:, 1]] = table[ends[:, 1], ends[:, 0]] = True
    return table
