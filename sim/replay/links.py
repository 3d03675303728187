"""Links between UAVs at each scan of a recording, with the messages that were lost."""

from __future__ import annotations

import numpy as np

from sim.mission.radio import Links, lost_messages, open_links
from sim.recording.recording import Recording
from sim.scenario.random_streams import stream
from sim.scenario.scenario import Scenario


def links_of(recording: Recording, scenario: Scenario) -> list[Links]:
    """The links of each scan, as the mission had them: they follow from places, scenario, seed and repeat alone."""
    rng, uavs = stream(recording.seed, "network", repeat=recording.repeat), recording.poses.shape[1]
    found = []
    for time, poses, working in zip(recording.times.tolist(), recording.poses, recording.working, strict=True):
        up = open_links(scenario.network, time, poses[:, :3]) & working[:, None] & working
        found.append(Links(np.asarray(up), lost_messages(scenario.network, uavs, rng)))
    return found
