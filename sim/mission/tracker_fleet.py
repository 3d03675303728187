"""The trackers of a scenario's UAVs, in a mission and when a recording is explained."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import NamedTuple

import numpy as np

from sim.mission.radio import Inbox, RadioLinks, Sender
from sim.mission.tracker_setup import make_tracker_parameters
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import view_of
from tracking.fleet import step
from tracking.fusion.checked_tracker import make_tracker
from tracking.fusion.late_scans import FleetState, ScanLog
from tracking.fusion.member import Member
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Indices
from tracking.track import Scan, Track

# Numbers of a message of scans, eight bytes each: sender and time; of each scan UAV, time and the camera's pose; of
# each measurement place and covariance.
_OF_MESSAGE, _OF_SCAN, _OF_MEASUREMENT = 2, 9, 5


class SentScan(NamedTuple):
    """A scan on its way through the fleet."""

    k: int  # number of the scan
    links: int  # over which it was passed on
    scan: Scan


def make_trackers(scenario: Scenario, forest: Forest, initial: Sequence[Track]) -> list[Member]:
    """One tracker per UAV; each has its own parameters and tracks, because a plug-in may change them."""
    name = scenario.tracking.tracker
    return [
        make_tracker(name, i, view_of(uav, scenario), forest, make_tracker_parameters(scenario), deepcopy(initial))
        for i, uav in enumerate(scenario.uavs)
    ]


class TrackerFleet:
    """The trackers of all UAVs, which agree in each scan by consensus or, if the network takes time, by late scans.

    In a network that takes time each UAV sends, at each scan, its own scan and those that were new to it, each over at
    most `network.rounds` links in all.
    """

    def __init__(self, scenario: Scenario, forest: Forest, initial: Sequence[Track]) -> None:
        self._network, self._trackers = scenario.network, make_trackers(scenario, forest, initial)
        uavs, self._k = range(len(self._trackers)), 0  # number of the next scan
        self.senders = [Sender(self._network) for _ in uavs]
        self._inboxes = [Inbox[list[SentScan]]() for _ in uavs]
        self.received: list[list[SentScan]] = [[] for _ in uavs]  # new to each UAV at the last scan
        start = FleetState(self._trackers, [forest])
        hold = max(round(self._network.holds * scenario.rates.sensing), 1)
        self._logs = [ScanLog(i, start, hold) for i in uavs] if self._network.takes_time else []

    def __getitem__(self, uav: int) -> Member:
        """A UAV's tracker after the last scan."""
        return self._logs[uav].tracker if self._logs else self._trackers[uav]

    def step(self, time: float, scans: Mapping[int, Scan], links: RadioLinks, working: Sequence[int]) -> Indices:
        """Update and fuse the trackers of the working UAVs at `time` s; returns the bytes (n,) that each UAV sends.

        scans: by UAV, of those that took a frame.
        """
        sent = np.zeros(len(self._trackers), dtype=np.int64)
        if self._logs:
            for i in working:
                self._receive(i, time, scans.get(i))
            for i in working:
                sent[i] = self._send(i, time, scans.get(i), links, working)
        elif working:
            between = links.among(working)
            sent[working] = step(
                [self._trackers[i] for i in working],
                [scans[i] for i in working if i in scans],
                between.up,
                rounds=self._network.rounds,
                lost=between.lost,
                time=time,
            )
        self._k += 1
        return sent

    def _receive(self, uav: int, time: float, own: Scan | None) -> None:
        log, arrived = self._logs[uav], [sent for message in self._inboxes[uav].take(time) for sent in message]
        self.received[uav] = [sent for sent in arrived if log.add(sent.k, sent.scan)]
        log.step(time, own)

    def _send(self, uav: int, time: float, own: Scan | None, links: RadioLinks, working: Sequence[int]) -> int:
        """Send a UAV's scans of this scan, and return the bytes; 0 if nobody can hear it."""
        known = [*([SentScan(self._k, 0, own)] if own else []), *self.received[uav]]
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
