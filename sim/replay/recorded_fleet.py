"""The UAVs of a recording, the links between them, and the map of trees."""

from functools import lru_cache

import numpy as np

from planning.planner import Vehicle
from sim.mission.radio import RadioLinks, draw_links
from sim.recording.recording import Recording
from sim.scenario.random_streams import stream
from sim.sensing.vehicles import vehicle_of
from tracking.geometry.visibility import Forest


@lru_cache(maxsize=1)  # with its grid
def make_known_forest(recording: Recording) -> Forest:
    """The map of trees with the occlusion that trackers and planners assumed."""
    return Forest(recording.forest.trees, recording.setting.sensing.occlusion)


def make_vehicles(recording: Recording, k: int) -> list[Vehicle]:
    """All UAVs at scan k, by id.

    Note: velocities are means since the previous scan, because recordings have none; at the first scan they are zero.
    """
    setting = recording.setting
    moved = recording.poses[k, :, :2] - recording.poses[max(k - 1, 0), :, :2]
    bodies = zip(recording.poses_at(k), moved * setting.rates.sensing, strict=True)
    return [vehicle_of(i, body, velocity, setting) for i, (body, velocity) in enumerate(bodies)]


def find_recorded_links(recording: Recording) -> list[RadioLinks]:
    """The links of each scan, computed again from places, scenario, seed and repeat, which alone determine them."""
    network = recording.setting.network
    rng = stream(recording.seed, "network", repeat=recording.repeat)
    found = []
    for time, poses, working in zip(recording.times.tolist(), recording.poses, recording.working, strict=True):
        links = draw_links(network, time, poses[:, :3], rng)
        found.append(links._replace(up=np.asarray(links.up & working[:, None] & working)))
    return found
