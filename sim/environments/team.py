"""Gymnasium environment: the team as one agent."""

import math
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import error, spaces
from numpy.typing import NDArray

from sim.environments.course import RENDER_MODES, Course, Episodes
from sim.environments.observations import Observed
from sim.environments.rewards import Reward
from sim.scenario.scenario import Scenario
from tracking.errors import InputError


class TeamEnv(Episodes, gymnasium.Env[Observed, NDArray[np.floating[Any]]]):
    """Mission with the team as one agent: actions (n, 2) and observations have a row for each of the n UAVs.

    For UAVs that have broken down, observations and the entries of the mask `working` (n,) are zero. The reward is the
    mean over the working UAVs.
    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES}  # noqa: RUF012 - Gymnasium's

    def __init__(
        self,
        scenario: str | Scenario = "forest",
        *,
        settings: Mapping[str, Any] | None = None,
        reward: str | Reward = "gospa",
        observe: Mapping[str, Any] | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Make the environment; arguments as in `understory.parallel_env`."""
        self._course = course = Course(scenario, settings, reward, observe, render_mode)
        if course.image and len({uav.pixels for uav in course.scenario.uavs}) > 1:
            raise InputError("observe: images of several sizes are not one array; give all UAVs the same pixels")
        self.render_mode = render_mode
        self.metadata = course.metadata
        one = course.spaces[0]
        self.observation_space = spaces.Dict(
            {
                **{name: _repeated(space, len(course.uavs)) for name, space in one.items()},
                "working": spaces.MultiBinary(len(course.uavs)),
            }
        )
        self.action_space = spaces.Box(-1.0, 1.0, (len(course.uavs), 2), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Start the mission of a seed; by default of one drawn from the generator that the last given seed started."""
        super().reset(seed=seed)
        self._course.begin(seed, options, self.np_random)
        return self._observed(), self._info()

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Fly to the next decision by actions (n, 2); actions of UAVs that have broken down are ignored."""
        course = self._course
        if np.shape(action) != self.action_space.shape:
            raise error.InvalidAction(f"action: of shape {np.shape(action)}, not {self.action_space.shape}")
        course.step({i: action[i] for i in course.rollout.team})
        team = course.rollout.team
        reward = math.fsum(course.rewarded(i) for i in team) / max(len(team), 1)
        return self._observed(), reward, not team, bool(team) and course.rollout.over, self._info()

    def _observed(self) -> Observed:
        each = [self._course.observe(i) for i in self._course.uavs]
        found: Observed = {name: np.stack([one[name] for one in each]) for name in each[0]}
        found["working"] = np.array([i in self._course.rollout.team for i in self._course.uavs], dtype=np.int8)
        return found

    def _info(self) -> dict[str, Any]:
        """Time, and means of OSPA and GOSPA over the working UAVs."""
        metrics = [self._course.rollout.metrics(i) for i in self._course.uavs]
        names = {name for each in metrics for name in each}
        return {name: float(np.mean([each[name] for each in metrics if name in each])) for name in sorted(names)}


def _repeated(space: spaces.Space[Any], count: int) -> spaces.Space[Any]:
    """Space of arrays that stack `count` elements of a space."""
    if isinstance(space, spaces.MultiBinary):
        return spaces.MultiBinary((count, *space.shape))
    assert isinstance(space, spaces.Box)
    low, high = (np.repeat(bound[None], count, axis=0) for bound in (space.low, space.high))
    return spaces.Box(low, high, dtype=space.dtype.type)
