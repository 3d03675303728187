"""Fusion over a radio that takes time: UAVs send scans, hold their past, and run it again when a scan arrives late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from weakref import WeakValueDictionary

from tracking.fusion.consensus import pool
from tracking.fusion.member import Member
from tracking.track import Scan


class FleetState:
    """The trackers of a whole fleet, by UAV, after a scan; it never changes, and UAVs with the same scans share it."""

    def __init__(self, trackers: Sequence[Member], fixed: Sequence[object] = ()) -> None:
        """`fixed`: objects that trackers never change, such as the map, which copies of trackers have in common."""
        self.trackers, self._fixed = trackers, fixed
        self._after = WeakValueDictionary[frozenset[int], FleetState]()

    def step(self, time: float, scans: Mapping[int, Scan]) -> FleetState:
        """The state after the scan at `time` s, of which the scans of some UAVs are known."""
        after = self._after.get(frozenset(scans))
        if after is None:
            trackers = deepcopy(self.trackers, {id(part): part for part in self._fixed})
            for tracker in trackers:
                if tracker.uav in scans:
                    tracker.step(scans[tracker.uav])
                else:
                    tracker.coast(time)
            pool(trackers)
            self._after[frozenset(scans)] = after = FleetState(trackers, self._fixed)
        return after


class ScanLog:
    """One UAV's scans and those that it has received from others, and the tracks to which they lead.

    At each scan the UAV has the tracks of a central tracker that takes the known scans in the order of their times.
    Each scan counts once, whenever and however often it arrives. The last `hold` scans of the fleet may still be
    completed; what arrives later is dropped. Source: [BarShalom02], whose exact update in one step a filter run again
    equals, and which knows neither association nor tracks that begin and end.
    Note: [Li22] has consensus without delays. Its L rounds of messages of a scan begin with the tracks after the rounds
    of the scan before, so that they fall behind further and further if they take longer than the time between scans.
    """

    def __init__(self, uav: int, start: FleetState, hold: int) -> None:
        if hold < 1:
            raise ValueError(f"hold must be at least 1 scan, is {hold}")
        self._uav, self._hold = uav, hold
        self._first = 0  # number of the first scan held
        self._times: list[float] = []  # s, of the scans held
        self._scans: list[dict[int, Scan]] = []  # by UAV, of each
        self._states = [start]  # before the first scan held, then after each one
        self._sound = 0  # number of states after scans held that no later arrival has changed

    @property
    def tracker(self) -> Member:
        """The UAV's own tracker after the last scan."""
        return next(tracker for tracker in self._states[-1].trackers if tracker.uav == self._uav)

    def add(self, k: int, scan: Scan) -> bool:
        """Take a scan of another UAV, number k of the fleet's scans; False if it is too late, or known."""
        at = k - self._first
        if at < 0 or scan.uav in self._scans[at]:
            return False
        self._scans[at][scan.uav] = scan
        self._sound = min(self._sound, at)
        return True

    def step(self, time: float, scan: Scan | None = None) -> None:
        """Go on to the fleet's next scan at `time` s, with the UAV's own one if its camera took a frame."""
        self._times.append(time)
        self._scans.append({} if scan is None else {self._uav: scan})
        del self._states[1 + self._sound :]
        for at in range(self._sound, len(self._scans)):
            self._states.append(self._states[-1].step(self._times[at], self._scans[at]))
        past = max(len(self._scans) - self._hold, 0)
        del self._times[:past], self._scans[:past], self._states[:past]
        self._first, self._sound = self._first + past, len(self._scans)
