"""The trackers of a scenario's UAVs, in a mission and when a recording is explained."""

from collections.abc import Mapping, Sequence
from copy import deepcopy

import numpy as np

from sim.mission.radio import RadioLinks
from sim.mission.scan_relay import ScanRelay, Sent
from sim.mission.tracker_setup import make_tracker_parameters
from sim.scenario.scenario import Scenario
from tracking.fusion.consensus import step
from tracking.fusion.late_scans import FleetState, ScanLog
from tracking.fusion.member import Member, make_tracker
from tracking.numerics.arrays import Indices
from tracking.track import Scan, Track


def make_trackers(scenario: Scenario, initial: Sequence[Track]) -> list[Member]:
    """One tracker per UAV; each has its own parameters and tracks, because a plug-in may change them."""
    made = []
    for i in range(len(scenario.uavs)):
        camera, parameters = scenario.believed_camera(i), make_tracker_parameters(scenario, i)
        made.append(make_tracker(scenario.tracking.tracker, i, camera, parameters, deepcopy(initial)))
    return made


class TrackerFleet:
    """The trackers of all UAVs, which agree in each scan by consensus or, if the network takes time, by late scans."""

    def __init__(self, scenario: Scenario, initial: Sequence[Track]) -> None:
        self._network = scenario.network
        self._trackers = make_trackers(scenario, initial)
        self.relay = ScanRelay(self._network, len(self._trackers))
        self._k = 0  # number of the next scan
        start = FleetState(self._trackers)
        wait = max(round(self._network.longest_wait * scenario.rates.sensing), 1)
        uavs = range(len(self._trackers) if self._network.takes_time else 0)
        self._logs = [ScanLog(i, start, wait) for i in uavs]

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
                for received in self.relay.receive(i, time):
                    if isinstance(received.content, Scan):
                        self._logs[i].add(received.k, received.content)
                    else:
                        self._logs[i].add_report(received.k, received.uav, received.content)
                self._logs[i].step(time, scans.get(i))
            for i in working:
                own = [Sent(self._k, i, scans[i])] if i in scans else []
                report = self._logs[i].report
                if report:
                    own.append(Sent(report[0], i, report[1]))
                sent[i] += self.relay.send(i, time, own, links, working)
        elif working:
            between = links if len(working) == len(self._trackers) else links.among(working)
            sent[working] += step(
                [self._trackers[i] for i in working],
                [scans[i] for i in working if i in scans],
                between.up,
                rounds=self._network.rounds,
                lost=between.lost,
                time=time,
            )
        self._k += 1
        return sent
