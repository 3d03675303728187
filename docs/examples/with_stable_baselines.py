"""Stable-Baselines3: PPO trains the team as one agent, for a moment only, and its policy flies as a planner.

Saves the policy as `policy.zip`, from which `understory run --planner with_stable_baselines:Learned` loads it.
"""

import gymnasium
import numpy as np
from stable_baselines3 import PPO

import understory

OBSERVE = {"tracks": 5, "trees": 5, "flat": True, "scaled": True}


class Learned:
    """Velocities of a fleet of three by a trained policy, which one UAV asks for all."""

    exchange = understory.Exchange(centre=True)

    def __init__(self, path="policy.zip"):
        self.policy = PPO.load(path, device="cpu")
        self.observations = understory.Observations(neighbours=2, **OBSERVE)

    def plan(self, team, rng):
        shares, _ = self.policy.predict(self.observations.of_team(team), deterministic=True)
        shares = shares / np.maximum(1.0, np.linalg.norm(shares, axis=1, keepdims=True))  # of the speed limit
        return [understory.Plan(s.own.max_speed * shares[[s.own.id]]) for s in team]


if __name__ == "__main__":
    settings = {"duration": 20, "sensing.mode": "ideal", "dynamics": "kinematic"}
    env = gymnasium.make("understory:understory/Forest-v0", settings=settings, observe=OBSERVE)
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, seed=0, device="cpu")
    model.learn(128)  # a million or more for a policy that is of use
    model.save("policy.zip")
    print(understory.run("forest", "with_stable_baselines:Learned", seed=3, settings={"duration": 2}))
