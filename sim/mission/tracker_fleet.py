"""The trackers of a scenario's UAVs, in a mission and when a recording is explained."""

from collections.abc import Mapping, Sequence
from copy import deepcopy

import numpy as np

from sim.mission.radio import RadioLinks
from sim.mission.tracker_setup import make_tracker_parameters
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import view_of
from tracking.fleet import step
from tracking.fusion.checked_tracker import make_tracker
from tracking.fusion.member import Member
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Indices
from tracking.track import Scan, Track


def make_trackers(scenario: Scenario, forest: Forest, initial: Sequence[Track]) -> list[Member]:
    """One tracker per UAV; each has its own parameters and tracks, because a plug-in may change them."""
    name = scenario.tracking.tracker
    return [
        make_tracker(name, i, view_of(uav, scenario), forest, make_tracker_parameters(scenario), deepcopy(initial))
        for i, uav in enumerate(scenario.uavs)
    ]


def step_trackers(
    scenario: Scenario,
    trackers: Sequence[Member],
    time: float,
    scans: Mapping[int, Scan],
    links: RadioLinks,
    working: Sequence[int],
) -> Indices:
    """Update and fuse the trackers of the working UAVs at `time` s; returns the bytes (n,) that each UAV sends.

    scans: by UAV, of those that took a frame.
    """
    sent = np.zeros(len(trackers), dtype=np.int64)
    if working:
        between = links.among(working)
        sent[working] = step(
            [trackers[i] for i in working],
            [scans[i] for i in working if i in scans],
            between.up,
            rounds=scenario.network.rounds,
            lost=between.lost,
            time=time,
        )
    return sent
