"""The true state of a mission as a vector, which training may use and a policy in flight may not."""

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sim.environments.episode import Episode
from tracking.errors import InputError

_UAV = ("x", "y", "z", "vx", "vy", "works")
_PERSON = ("x", "y", "vx", "vy", "present")


def make_space(uavs: int, people: int) -> spaces.Box:
    """Space of the states of missions with a number of UAVs and of people."""
    return spaces.Box(-np.inf, np.inf, (1 + len(_UAV) * uavs + len(_PERSON) * people,), np.float32)


def make_state(episode: Episode, box: spaces.Box) -> NDArray[np.float32]:
    """Time, UAVs and people at the present decision, then zeros; InputError if there are more people than rows."""
    now, mission = episode.now, episode.mission
    uavs = np.zeros((len(now.poses), len(_UAV)))
    uavs[:, :3] = [pose.position for pose in now.poses]
    for uav, situation in episode.team.items():
        uavs[uav, 3:] = *situation.own.velocity, 1.0
    half, end = 0.5 / mission.scenario.rates.sensing, float(mission.people.times[-1])
    begun, ended = max(0.0, now.time - half), min(now.time + half, end)
    moved = mission.people.at(ended).positions - mission.people.at(begun).positions
    present = ~np.isnan(now.people[:, :1])
    people = np.nan_to_num(np.hstack([now.people, moved / (ended - begun), present]))
    found = np.concatenate([[now.time], uavs.ravel(), people.ravel()])
    if len(found) > box.shape[0]:
        raise InputError(f"state: has no room for {len(people)} people; make the environment with as many")
    return np.pad(found, (0, box.shape[0] - len(found))).astype(np.float32)
