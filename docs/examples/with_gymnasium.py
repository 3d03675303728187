"""Gymnasium: the team is one agent, whose action is a velocity for each UAV; here each flies to its nearest track.

Prints the sum of rewards beside that of random actions, and saves the last picture as `last.png`.
"""

import cv2
import gymnasium
import numpy as np

settings = {"duration": 10, "sensing.mode": "ideal", "dynamics": "kinematic"}
env = gymnasium.make("understory:understory/Forest-v0", settings=settings, render_mode="rgb_array")


def chase(observation):
    """Velocities (n, 2), as shares of the top speed, towards the nearest track of each UAV."""
    actions = np.zeros(env.action_space.shape)
    for uav, (tracks, mask) in enumerate(zip(observation["tracks"], observation["tracks_mask"])):
        gaps = tracks[mask > 0][:, :2]  # m, from the UAV
        if len(gaps):
            gap = gaps[np.linalg.norm(gaps, axis=1).argmin()]
            actions[uav] = gap / max(np.linalg.norm(gap), 5.0)
    return actions


for name, policy in (("chase", chase), ("random", lambda observation: env.action_space.sample())):
    env.action_space.seed(0)
    observation, _ = env.reset(seed=3)
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy(observation))
        total, over = total + reward, terminated or truncated
    print(f"{name}: sum of rewards {total:.1f}, {env.unwrapped.flight()}")
cv2.imwrite("last.png", np.ascontiguousarray(env.render()[..., ::-1]))
