"""Exchange of maps of trees between UAVs: each sends its own, and those that a neighbour says it lacks."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim.mission.radio import Inbox, RadioLinks
from sim.mission.scan_relay import ScanRelay
from sim.scenario.uavs import Network
from tracking.mapping.fusion import TreeMap
from tracking.numerics.arrays import Indices

_OF_MESSAGE, _OF_VERSION = 2, 2  # numbers of eight bytes: sender and time; UAV and time of each map


class DatedMap(NamedTuple):
    """A map that a UAV made of its own frames."""

    time: float  # s, when it was made
    map: TreeMap


class _Statement(NamedTuple):
    """Which maps a UAV has at a time."""

    uav: int
    time: float  # s
    versions: dict[int, float]  # s, times of the maps by the UAV that made them


class _Message(NamedTuple):
    statement: _Statement
    maps: dict[int, DatedMap]


class MapExchange:
    """The newest map of each UAV that each one has received.

    A message has the sender's own map and the times of all maps that it has. A neighbour who has an older one of a
    third UAV than the sender had at that time gets the sender's with the next message. So maps pass on over several
    links and lost ones are sent again; a fleet that was split agrees after two messages for each link that a map has to
    pass. Each map is replaced by a newer one of the same UAV only, so that no frame counts twice.
    Source: anti-entropy, A. Demers et al., Epidemic algorithms for replicated database maintenance, PODC 1987.
    """

    def __init__(self, network: Network, uavs: int) -> None:
        self._network = network
        self._known: list[dict[int, DatedMap]] = [{} for _ in range(uavs)]
        self._stated: list[list[_Statement]] = [[] for _ in range(uavs)]
        self._heard: list[dict[int, _Statement]] = [{} for _ in range(uavs)]  # the latest of each other UAV
        self._inboxes = [Inbox[_Message]() for _ in range(uavs)]

    def publish(self, uav: int, made: DatedMap) -> None:
        """Take a UAV's own map, which replaces its last one."""
        self._known[uav][uav] = made

    def maps(self, uav: int) -> dict[int, DatedMap]:
        """The maps that a UAV has, by the UAV that made them, in order of these."""
        return {origin: self._known[uav][origin] for origin in sorted(self._known[uav])}

    def step(
        self, time: float, senders: Sequence[int], links: RadioLinks, working: Sequence[int], relay: ScanRelay
    ) -> Indices:
        """Send messages of some working UAVs, and take in what has arrived; return the bytes (n,) that each sends."""
        sent = np.zeros(len(self._known), dtype=np.int64)
        for i in senders:
            sent[i] = self._send(i, time, [j for j in working if links.up[j, i]], links, relay)
        for i in working:
            for message in self._inboxes[i].take(time):
                self._receive(i, message)
        return sent

    def _send(self, uav: int, time: float, hearing: Sequence[int], links: RadioLinks, relay: ScanRelay) -> int:
        known = self._known[uav]
        maps = {origin: known[origin] for origin in known if self._is_due(uav, origin, hearing)}
        statement = _Statement(uav, time, {origin: made.time for origin, made in known.items()})
        self._stated[uav].append(statement)
        if not hearing:
            return 0
        size = 8 * (_OF_MESSAGE + _OF_VERSION * len(known))
        for made in maps.values():
            size += made.map.size
        done = relay.transmit(uav, time, size) if self._network.takes_time else time
        if done is None:
            return 0
        received = links.first_round[:, uav]
        for j in hearing:
            if received[j]:
                late = 0.0 if links.jitter is None else float(links.jitter[j, uav])
                self._inboxes[j].put(done + self._network.delay + late, _Message(statement, maps))
        return size

    def _is_due(self, uav: int, origin: int, hearing: Sequence[int]) -> bool:
        """True if a UAV has to send the map of `origin`: its own, and one that somebody who hears it lacks."""
        if origin == uav:
            return True
        for statement in (self._heard[uav][j] for j in hearing if j in self._heard[uav] and j != origin):
            own = next((own.versions for own in reversed(self._stated[uav]) if own.time <= statement.time), {})
            if statement.versions.get(origin, -1.0) < own.get(origin, -1.0):
                return True
        return False

    def _receive(self, uav: int, message: _Message) -> None:
        sender, heard, known = message.statement.uav, self._heard[uav], self._known[uav]
        if sender not in heard or heard[sender].time < message.statement.time:
            heard[sender] = message.statement
        for origin, made in message.maps.items():
            if origin != uav and (origin not in known or known[origin].time < made.time):
                known[origin] = made
