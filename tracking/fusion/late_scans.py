"""Fusion over a radio that takes time: UAVs send scans, hold their past, and run it again when a scan arrives late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from weakref import WeakValueDictionary

import numpy as np

from tracking.fusion.consensus import combine, pool
from tracking.fusion.member import Member, accept_messages, step_members
from tracking.fusion.message import Message, Partition
from tracking.track import Scan


class FleetState:
    """The trackers of a whole fleet, by UAV, after a scan; it never changes, and UAVs with the same scans share it."""

    def __init__(self, trackers: Sequence[Member], pooled: Message | None = None) -> None:
        """Trackers, which accepted the message `pooled` at the last scan."""
        self.trackers = trackers
        self.pooled = pooled
        self._after = WeakValueDictionary[frozenset[int], FleetState]()

    def find(self, uav: int) -> Member:
        """The tracker of a UAV."""
        return next(tracker for tracker in self.trackers if tracker.uav == uav)

    def step(self, time: float, scans: Mapping[int, Scan], agreed: Message | None = None) -> FleetState:
        """The state after the scan at `time` s, for which the scans of some UAVs are known.

        agreed: message to accept in place of the one from these scans.
        """
        after = None if agreed else self._after.get(frozenset(scans))
        if after is None:
            trackers = [tracker.copy() for tracker in self.trackers]
            step_members(trackers, time, scans)
            pooled = pool(trackers)
            accept_messages(trackers, [agreed or pooled] * len(trackers))
            after = FleetState(trackers, agreed or pooled)
            if not agreed:
                self._after[frozenset(scans)] = after
        return after


def average_reports(reports: Mapping[int, Message], max_speed: float) -> Message | None:
    """Average of the different messages of one scan that UAVs, by number, accepted; None if all accepted the same.

    Tracks of one person get one id, as when partitions of a fleet meet. No information counts twice: beliefs are
    averaged as Kullback and Leibler define, and so is each UAV's share of the information that the scan added.
    """
    different: dict[tuple[bytes, ...], Message] = {}
    for uav, told in sorted(reports.items()):
        content = tuple(part.tobytes() for part in (told.ids, told.shares, told.novel, told.times, told.sightings))
        keys = np.column_stack([np.full(len(told.ids), uav), told.ids])
        different.setdefault(content, replace(told, uav=uav, partition=Partition(uav, told.time), keys=keys))
    if len(different) < 2:
        return None
    first, *others = (replace(told, degree=len(different) - 1) for told in different.values())
    joint = combine(first, others, max_speed)
    return replace(joint, partition=Partition(0, joint.time))  # as of trackers in one place


class ScanLog:
    """One UAV's own scans, those that it has received from others, and the tracks that follow from them.

    At each scan the UAV has the tracks of a central tracker that takes the known scans in the order of their times.
    Each scan counts once, whenever and however often it arrives. The last `hold` scans of the fleet may still be
    completed; what arrives later is dropped. Source: [BarShalom02]. Its exact update in one step equals a filter that
    is run again; it has no association, and its tracks neither begin nor end.

    If UAVs lack different scans, their tracks become different. So after each `hold` scans a UAV reports the tracks of
    the last scan that can no longer be completed. After as much time for reports to arrive, it continues from the
    average of the reports that differ, and runs the scans since then again.
    Note: [Li22] has consensus without delays. The L rounds of a scan begin with the tracks after the rounds of the scan
    before. If rounds take longer than the time between scans, they would fall ever further behind.
    """

    def __init__(self, uav: int, start: FleetState, hold: int) -> None:
        self._uav = uav
        self._hold = hold
        self._first = 0  # number of the first scan kept
        self._times: list[float] = []  # s, of the scans kept
        self._scans: list[dict[int, Scan]] = []  # by UAV, of each
        self._states = [start]  # before the first scan kept, then after each one
        self._sound = 0  # number of states after scans kept that no later arrival has changed
        self._reports: dict[int, dict[int, Message]] = {}  # by scan and UAV

    @property
    def tracker(self) -> Member:
        """The UAV's own tracker after the last scan."""
        return self._states[-1].find(self._uav)

    @property
    def report(self) -> tuple[int, Message] | None:
        """Number of a scan, and the UAV's message about its tracks, if it has to send one at this scan."""
        last = self._first + len(self._times) - 1
        reported = last - self._hold
        return (reported, self._reports[reported][self._uav]) if reported >= 0 and last % self._hold == 0 else None

    def add(self, k: int, scan: Scan) -> bool:
        """Take a scan of another UAV, number k of the fleet's scans; False if it is too late, or known.

        ValueError if the log has not come to this scan yet.
        """
        at = k - self._first
        if at >= len(self._times):
            last = self._first + len(self._times) - 1
            raise ValueError(f"k: scan {k} is ahead of this log, whose last scan is {last}; step it up to there before")
        if len(self._times) - at > self._hold or scan.uav in self._scans[at]:
            return False
        self._scans[at][scan.uav] = scan
        self._sound = min(self._sound, at)
        return True

    def add_report(self, k: int, uav: int, report: Message) -> None:
        """Take another UAV's report about scan k; without effect if it is too late."""
        self._reports.setdefault(k, {})[uav] = report

    def step(self, time: float, scan: Scan | None = None) -> None:
        """Go on to the fleet's next scan at `time` s, with the UAV's own one if its camera took a frame."""
        self._times.append(time)
        self._scans.append({} if scan is None else {self._uav: scan})
        last, hold = self._first + len(self._times) - 1, self._hold
        due = last % hold == 0
        if due and last >= 2 * hold:
            k = last - 2 * hold
            at, agreed = k - self._first, average_reports(self._reports[k], self.tracker.max_speed)
            if agreed:
                self._states[at + 1] = self._states[at].step(self._times[at], self._scans[at], agreed)
                self._sound = at + 1
            self._reports = {n: reports for n, reports in self._reports.items() if n > k}
        del self._states[1 + self._sound :]
        for at in range(self._sound, len(self._scans)):
            self._states.append(self._states[-1].step(self._times[at], self._scans[at]))
        if due and last >= hold:
            settled = self._states[last - hold - self._first + 1].pooled
            assert settled  # as it is after a scan
            self.add_report(last - hold, self._uav, settled)
        past = max(len(self._scans) - 2 * hold, 0)
        del self._times[:past], self._scans[:past], self._states[:past]
        self._first, self._sound = self._first + past, len(self._scans)
