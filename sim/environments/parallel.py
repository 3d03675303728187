"""PettingZoo environment in which each UAV is an agent."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import error, spaces
from gymnasium.utils import seeding
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from sim.environments.mission_environment import RENDER_MODES, MissionEnvironment, Observation
from tracking.errors import did_you_mean


class TeamParallelEnv(MissionEnvironment, ParallelEnv[str, Observation, NDArray[np.floating[Any]]]):  # type: ignore[misc]
    """Mission with UAVs `uav_0`, `uav_1`, ... as agents; see `understory.parallel_env`."""

    metadata: dict[str, Any] = {"name": "understory_v0", "render_modes": RENDER_MODES}  # noqa: RUF012 - PettingZoo's

    def _set_up(self) -> None:
        self.possible_agents = [f"uav_{i}" for i in self._uavs]
        self.agents: list[str] = []
        self.observation_spaces = dict(zip(self.possible_agents, map(self._flatten_space, self._spaces), strict=True))
        self.action_spaces = {agent: spaces.Box(-1.0, 1.0, (2,), np.float32) for agent in self.possible_agents}
        self._last: dict[str, Observation] = {}
        self.np_random, self.np_random_seed = seeding.np_random()

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Observation space of an agent."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Box:
        """Action space of an agent: velocities east and north as fractions of the UAV's speed limit."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start the mission of a seed. Without a seed one is drawn, in a sequence that the last given seed decides."""
        asked = self._read_reset(seed, options)
        if asked.seed is not None:
            self.np_random, self.np_random_seed = seeding.np_random(asked.seed)
        self.agents = [f"uav_{i}" for i in self._start(asked, self.np_random).team]
        self._last = {agent: self._observe_agent(agent) for agent in self.agents}
        return dict(self._last), self._make_infos(self.agents)

    def step(
        self, actions: dict[str, NDArray[np.floating[Any]]]
    ) -> tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Fly to the next decision; an agent that breaks down is terminated and keeps its last observation.

        Actions of agents that have broken down before are ignored. Without agents and actions, all results are empty,
        as wrappers expect that go on after the end.
        """
        flying = self.agents
        if not isinstance(actions, Mapping):
            raise error.InvalidAction(f"actions: {type(actions).__name__} is not allowed; expected a dict by agent")
        for agent in actions:
            if agent not in self.possible_agents:
                near = did_you_mean(str(agent), self.possible_agents)
                raise error.InvalidAction(f"actions: {agent!r} is unknown; {near}")
        for agent in flying:
            if agent not in actions:
                raise error.InvalidAction(f"actions: that of {agent} is missing; expected one of each of {flying}")
        if self._require_episode().over and not actions:
            return {}, {}, {}, {}, {}
        self._fly({_parse_id(agent): actions[agent] for agent in flying})
        episode = self._require_episode()
        left = [agent for agent in flying if _parse_id(agent) in episode.team]
        self._last |= {agent: self._observe_agent(agent) for agent in left}
        self.agents = [] if episode.over else left
        return (
            {agent: self._last[agent] for agent in flying},
            {agent: self._compute_reward(_parse_id(agent)) for agent in flying},
            {agent: agent not in left for agent in flying},
            {agent: agent in left and episode.over for agent in flying},
            self._make_infos(flying),
        )

    def _observe_agent(self, agent: str) -> Observation:
        uav = _parse_id(agent)
        return self._flatten(self._spaces[uav], self._observe(uav))

    def _make_infos(self, agents: list[str]) -> dict[str, dict[str, Any]]:
        return {agent: self._require_episode().metrics(_parse_id(agent)) for agent in agents}


def _parse_id(agent: str) -> int:
    return int(agent.removeprefix("uav_"))
