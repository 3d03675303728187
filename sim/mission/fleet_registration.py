"""Registration of a scenario's fleet: UAVs correct their scans, and tell their tracks with the errors left in them."""

from collections.abc import Mapping, Sequence

import numpy as np

from sim.mission.radio import RadioLinks
from sim.mission.scan_relay import Sent
from sim.mission.tracker_setup import make_tracker_parameters
from sim.scenario.scenario import Scenario
from tracking.fusion.member import Member
from tracking.numerics.arrays import Indices
from tracking.registration.registration import Registration
from tracking.track import Scan, Track


class FleetRegistration:
    """The registrations of all UAVs, with `tracking.pose_errors` "inflate" or "estimate".

    To estimate errors, each UAV sends its scans to those that hear it. In a network that takes time, where UAVs see
    one another's scans only later, errors add to covariances instead.
    """

    def __init__(self, scenario: Scenario, initial: Sequence[Track]) -> None:
        parameters = make_tracker_parameters(scenario)
        self._motion = parameters.motion
        self._learns = scenario.tracking.pose_errors == "estimate" and not scenario.network.takes_time
        self.of_uavs = [
            Registration(
                [uav.navigation_errors for uav in scenario.uavs],
                initial,
                parameters.measurement_gate,
                learns=self._learns,
            )
            for _ in scenario.uavs
        ]

    def count_bytes(self, scans: Mapping[int, Scan], links: RadioLinks, working: Sequence[int]) -> Indices:
        """Bytes (n,) of the scans that each UAV sends to those that hear it."""
        sent = np.zeros(len(self.of_uavs), dtype=np.int64)
        for i, scan in scans.items() if self._learns else ():
            if links.up[working, i].any():
                sent[i] = Sent(0, i, scan).size
        return sent

    def correct(
        self, time: float, scans: Mapping[int, Scan], members: Mapping[int, Member], links: RadioLinks
    ) -> dict[int, Scan]:
        """The scans as each UAV corrects its own, with the help of those that it receives; members: those that work."""
        contact, corrected = links.contact, dict[int, Scan]()
        for i, member in members.items():
            received = {j: scan for j, scan in scans.items() if j == i or contact[i, j]}
            motion = getattr(member, "motion", self._motion)
            self.of_uavs[i].observe(time, received, member.tracks, motion)
            if i in scans:
                corrected[i] = self.of_uavs[i].correct(scans[i])
        return corrected

    def tell(self, member: Member) -> tuple[Track, ...]:
        """Tracks of a UAV's tracker after the scan, with the errors of poses that are left in them."""
        return self.of_uavs[member.uav].tell(member.tracks)
