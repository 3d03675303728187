"""Gymnasium environment: the team as one agent."""

import math
from typing import Any

import gymnasium
import numpy as np
from gymnasium import error, spaces
from numpy.typing import NDArray

from sim.environments.mission_environment import MissionEnvironment, Observation, make_mask_space, make_zeros
from sim.environments.observations import Observed
from tracking.errors import InputError


class TeamEnv(MissionEnvironment, gymnasium.Env[Observation, NDArray[np.floating[Any]]]):
    """Mission with the team as one agent: actions (n, 2) and observations have a row for each of the n UAVs.

    For UAVs that have broken down, observations and the entries of the mask `working` (n,) are zero. The reward is the
    mean over the working UAVs.
    """

    def _set_up(self) -> None:
        if self._image and len({uav.true_camera.size for uav in self._scenario.uavs}) > 1:
            raise InputError("observe: images of several sizes are not one array; give all UAVs the same pixels")
        count = len(self._uavs)
        repeated = {name: _repeat(space, count) for name, space in self._spaces[0].items()}
        self._whole = spaces.Dict({**repeated, "working": make_mask_space(count)})
        self.observation_space = self._flatten_space(self._whole)
        self.action_space = spaces.Box(-1.0, 1.0, (count, 2), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start the mission of a seed. Without a seed one is drawn, in a sequence that the last given seed decides."""
        asked = self._read_reset(seed, options)
        super().reset(seed=asked.seed)
        self._start(asked, self.np_random)
        return self._observe_all(), self._make_info()

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fly to the next decision by actions (n, 2); actions of UAVs that have broken down are ignored."""
        if np.shape(action) != self.action_space.shape:
            raise error.InvalidAction(f"action: of shape {np.shape(action)}, not {self.action_space.shape}")
        episode = self._require_episode()
        self._fly({i: action[i] for i in episode.team})
        team = episode.team
        reward = math.fsum(map(self._compute_reward, team)) / max(len(team), 1)
        return self._observe_all(), reward, not team, bool(team) and episode.over, self._make_info()

    def _observe_all(self) -> Observation:
        team = self._require_episode().team
        if not team:
            return self._flatten(self._whole, {name: make_zeros(space) for name, space in self._whole.items()})
        found: Observed = self._observations.of_team(team.values())
        if self._image:
            found["image"] = np.stack([self._show(i) for i in self._uavs])
        return self._flatten(self._whole, found)

    def _make_info(self) -> dict[str, Any]:
        """Time, and means of OSPA and GOSPA over the working UAVs."""
        metrics = [self._require_episode().metrics(i) for i in self._uavs]
        names = {name for each in metrics for name in each}
        return {name: float(np.mean([each[name] for each in metrics if name in each])) for name in sorted(names)}


def _repeat(space: spaces.Space[Any], count: int) -> spaces.Space[Any]:
    """Space of arrays that stack `count` elements of a space."""
    assert isinstance(space, spaces.Box)
    low, high = (np.repeat(bound[None], count, axis=0) for bound in (space.low, space.high))
    return spaces.Box(low, high, dtype=space.dtype.type)
