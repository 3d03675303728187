"""Scans on their way through a fleet whose network takes time, each with the time it refers to."""

from collections.abc import Sequence
from typing import NamedTuple

from sim.mission.radio import Inbox, RadioLinks, Sender
from sim.scenario.uavs import Network
from tracking.track import Scan

# Numbers of a message of scans, eight bytes each: sender and time; of each scan UAV, time and the camera's pose; of
# each measurement place and covariance.
_OF_MESSAGE, _OF_SCAN, _OF_MEASUREMENT = 2, 9, 5


class SentScan(NamedTuple):
    """A scan on its way."""

    k: int  # number of the scan
    links: int  # over which it was passed on
    scan: Scan


class ScanRelay:
    """What each UAV sends and receives: at each scan its own one, and those that were new to it.

    Each scan passes over at most `network.rounds` links, and is dropped when it is older than `network.hold`.
    """

    def __init__(self, network: Network, uavs: int) -> None:
        self._network = network
        self.senders = [Sender(network) for _ in range(uavs)]
        self._inboxes = [Inbox[list[SentScan]]() for _ in range(uavs)]
        self._known: list[set[tuple[int, int]]] = [set() for _ in range(uavs)]  # numbers and UAVs of scans
        self.received: list[list[SentScan]] = [[] for _ in range(uavs)]  # new to each UAV at the last scan

    def receive(self, uav: int, time: float) -> list[SentScan]:
        """What has arrived at a UAV by `time` s, without scans that it knows or that are too old."""
        self.received[uav], known = [], self._known[uav]
        for message in self._inboxes[uav].take(time):
            for sent in message:
                name = sent.k, sent.scan.uav
                if name not in known and time - sent.scan.time <= self._network.holds:
                    known.add(name)
                    self.received[uav].append(sent)
        return self.received[uav]

    def send(self, uav: int, k: int, time: float, own: Scan | None, links: RadioLinks, working: Sequence[int]) -> int:
        """Send a UAV's scan k and what it has just received; return the bytes, 0 if no working UAV can hear it."""
        known = [*([SentScan(k, 0, own)] if own else []), *self.received[uav]]
        if own:
            self._known[uav].add((k, uav))
        told = [sent._replace(links=sent.links + 1) for sent in known if sent.links < self._network.rounds]
        hearing = [i for i in working if links.up[i, uav]]
        if not told or not hearing:
            return 0
        size = 8 * (_OF_MESSAGE + _OF_SCAN * len(told))
        for sent in told:
            size += 8 * _OF_MEASUREMENT * len(sent.scan.measurements)
        done, contact = self.senders[uav].send(time, size), links.contact
        if done is None:
            return 0
        for i in hearing:
            if contact[i, uav]:
                jitter = 0.0 if links.jitter is None else float(links.jitter[i, uav])
                self._inboxes[i].put(done + self._network.delay + jitter, told)
        return size
