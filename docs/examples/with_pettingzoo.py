"""PettingZoo: each UAV is an agent with its own knowledge and reward, and a reward function of yours may see the truth.

Prints what an agent observes, and the reward of each; the episode is saved as `episode.npz`.
"""

import numpy as np

import understory


def reward(situation, people):
    """Minus the number of people (M, 2) m without a track of this UAV within 2 m."""
    tracks = np.array([track.belief.mean[:2] for track in situation.tracks]).reshape(-1, 2)
    gaps = np.linalg.norm(people[:, None] - tracks, axis=2)
    return -float(np.sum(gaps.min(axis=1, initial=np.inf) > 2.0))


settings = {"duration": 8, "sensing.mode": "ideal", "dynamics": "kinematic", "uavs.1.fails_at": 5}
env = understory.parallel_env("forest", settings=settings, reward=reward)
observations, infos = env.reset(seed=3)
print({name: array.shape for name, array in observations["uav_0"].items()})
totals = dict.fromkeys(env.agents, 0.0)
for k, agent in enumerate(env.agents):
    env.action_space(agent).seed(k)
while env.agents:  # UAV 1 breaks down at 5 s and leaves
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    observations, rewards, terminations, truncations, infos = env.step(actions)
    for agent, value in rewards.items():
        totals[agent] += value
print(totals, {name: round(value, 2) for name, value in infos["uav_0"].items()})
env.flight().save("episode.npz")
