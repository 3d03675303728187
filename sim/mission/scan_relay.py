"""Scans and reports on tracks on their way through a fleet whose network takes time, each with its own time."""

from collections.abc import Sequence
from typing import NamedTuple

from sim.mission.radio import Inbox, RadioLinks, Sender
from sim.scenario.uavs import Network
from tracking.fusion.message import Message
from tracking.track import Scan

# Numbers of a message, eight bytes each: sender and time; of each scan UAV, time and the camera's pose; of each
# measurement place and covariance.
_OF_MESSAGE, _OF_SCAN, _OF_MEASUREMENT = 2, 9, 5


class Sent(NamedTuple):
    """A scan, or a UAV's report on its tracks after a scan, on its way."""

    k: int  # number of the scan
    uav: int
    content: Scan | Message
    links: int = 0  # over which it was passed on

    @property
    def size(self) -> int:
        """Bytes."""
        if isinstance(self.content, Message):
            return self.content.size
        return 8 * (_OF_SCAN + _OF_MEASUREMENT * len(self.content.measurements))


class ScanRelay:
    """What each UAV sends and receives: at each scan its own one, and what was new to it since the last.

    All passes over at most `network.rounds` links. Scans are dropped when they are older than `network.hold`, and
    reports, which are sent at that age, when they are twice as old.
    """

    def __init__(self, network: Network, uavs: int) -> None:
        self._network = network
        self.senders = [Sender(network) for _ in range(uavs)]
        self._inboxes = [Inbox[list[Sent]]() for _ in range(uavs)]
        self._known: list[set[tuple[int, int, type]]] = [set() for _ in range(uavs)]
        self.received: list[list[Sent]] = [[] for _ in range(uavs)]  # new to each UAV at the last scan

    def receive(self, uav: int, time: float) -> list[Sent]:
        """Messages that have arrived at a UAV by `time` s, without those that it knows and those that are too old."""
        self.received[uav] = []
        known = self._known[uav]
        for message in self._inboxes[uav].take(time):
            for sent in message:
                name = sent.k, sent.uav, type(sent.content)
                age = self._network.longest_wait * (2 if isinstance(sent.content, Message) else 1)
                if name not in known and time - sent.content.time <= age:
                    known.add(name)
                    self.received[uav].append(sent)
        return self.received[uav]

    def transmit(self, uav: int, time: float, size: int) -> float | None:
        """Send a UAV's map or plan of so many bytes; return when it is sent [s], None if it is dropped.

        They have no transmitter of their own, so they keep scans waiting: in a mission, and where recorded bytes are
        sent again.
        """
        return self.senders[uav].send(time, size)

    def send(
        self,
        uav: int,
        time: float,
        own: Sequence[Sent],
        links: RadioLinks,
        working: Sequence[int],
        size: int | None = None,
    ) -> int:
        """Send what is a UAV's own and what it has just received; return the bytes, 0 if no working UAV can hear it.

        size: bytes, if these are known already.
        """
        self._known[uav].update((sent.k, sent.uav, type(sent.content)) for sent in own)
        known = [*own, *self.received[uav]]
        told = [sent._replace(links=sent.links + 1) for sent in known if sent.links < self._network.rounds]
        hearing = [i for i in working if links.up[i, uav]]
        if not told or not hearing:
            return 0
        if size is None:
            size = 8 * _OF_MESSAGE
            for sent in told:
                size += sent.size
        done = self.senders[uav].send(time, size)
        if done is None:
            return 0
        contact = links.contact
        for i in hearing:
            if contact[i, uav]:
                jitter = 0.0 if links.jitter is None else float(links.jitter[i, uav])
                self._inboxes[i].put(done + self._network.delay + jitter, told)
        return size
