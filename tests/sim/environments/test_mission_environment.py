"""Several environments share one process, and observe UAVs that have broken down as zeros."""

import gymnasium
import numpy as np

import understory


def test_an_environment_that_begins_anew_leaves_the_world_of_another_alone():
    """The other one has the place in the engine that the first gave back at the end of its mission."""
    settings = {"duration": 1, "sensing.mode": "ideal"}
    one, other = (understory.parallel_env("forest", settings=settings) for _ in range(2))
    one.reset(seed=0)
    while one.agents:
        one.step(dict.fromkeys(one.agents, np.zeros(2)))
    other.reset(seed=1)
    one.reset(seed=2)
    for env in (other, one):
        agents = env.agents
        observations, *_ = env.step(dict.fromkeys(agents, np.zeros(2)))
        assert list(observations) == agents and all(env.observation_space(a).contains(observations[a]) for a in agents)
        env.close()


def test_observations_of_a_uav_that_broke_down_are_zeros_and_no_chance(monkeypatch):
    settings = {"duration": 1, "dynamics": "kinematic", "uavs.1.fails_at": 0}
    env = gymnasium.make("understory/Forest-v0", settings=settings, observe={"image": True}).unwrapped
    for space in (gymnasium.spaces.Box, gymnasium.spaces.MultiBinary):
        monkeypatch.setattr(space, "sample", None)
    observation, _ = env.reset(seed=0)
    assert observation["working"].tolist() == [1, 0, 1] and env.observation_space.contains(observation)
    assert not any(rows[1].any() for rows in observation.values()) and observation["image"][0].any()
