"""Libraries for learning train and wrap the environments. They are installed by `pip install -e '.[rl-test]'`."""

from functools import partial

import gymnasium
import numpy as np
import pytest

import understory

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]
SETTINGS = {"sensing.mode": "ideal", "dynamics": "kinematic", "duration": 5}
FAILING = {**SETTINGS, "uavs.1.fails_at": 1.5}


def team(**options):
    return gymnasium.make("understory/Forest-v0", settings=SETTINGS, **options)


def agents(**observe):
    return understory.parallel_env("forest", settings=FAILING, observe=observe)


def play(env):
    """Results of all steps of an episode with the same actions of all possible agents."""
    env.reset(seed=3)
    steps = []
    while env.agents:
        steps.append(env.step(dict.fromkeys(env.possible_agents, np.full(2, 0.3, dtype=np.float32))))
    return steps


@pytest.mark.parametrize("flat", [False, True])
def test_stable_baselines_trains_in_this_and_in_other_processes_with_the_same_returns(flat):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_checker import check_env
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecFrameStack

    make = partial(team, observe={"flat": flat})
    check_env(make().unwrapped)
    returns = []
    for vector in (DummyVecEnv, SubprocVecEnv):
        envs = VecFrameStack(vector([lambda: Monitor(make())] * 2), 3)
        policy = "MlpPolicy" if flat else "MultiInputPolicy"
        model = PPO(policy, envs, n_steps=8, batch_size=8, n_epochs=1, seed=0, device="cpu").learn(32)
        returns.append([episode["r"] for episode in model.ep_info_buffer])
        envs.close()
    assert returns[0] == returns[1] and len(returns[0]) == 6


def test_supersuit_skips_frames_and_keeps_the_dead():
    supersuit = pytest.importorskip("supersuit")
    plain = play(agents())
    skipped = play(supersuit.frame_skip_v0(agents(), 2))
    assert len(skipped) == 3 and skipped[0][1]["uav_1"] == plain[0][1]["uav_1"] + plain[1][1]["uav_1"]
    assert skipped[0][2] == {"uav_0": False, "uav_1": True, "uav_2": False}
    kept = play(supersuit.black_death_v3(agents(flat=True)))
    assert all(set(step[0]) == {"uav_0", "uav_1", "uav_2"} for step in kept)
    assert not kept[2][0]["uav_1"].any() and kept[2][1]["uav_1"] == 0.0 and all(kept[-1][2].values())


def test_a_policy_shared_by_agents_trains_through_supersuit():
    supersuit, baselines = pytest.importorskip("supersuit"), pytest.importorskip("stable_baselines3")
    env = supersuit.pettingzoo_env_to_vec_env_v1(supersuit.black_death_v3(agents(flat=True)))
    envs = supersuit.concat_vec_envs_v1(env, 2, num_cpus=0, base_class="stable_baselines3")
    model = baselines.PPO("MlpPolicy", envs, n_steps=8, batch_size=8, n_epochs=1, device="cpu")
    before = [weights.clone() for weights in model.policy.parameters()]
    model.learn(96)
    changed = [not (one == other).all() for one, other in zip(before, model.policy.parameters(), strict=True)]
    assert model.num_timesteps >= 96 and any(changed)


def test_torchrl_wraps_both_environments():
    pytest.importorskip("torchrl")
    from torchrl.envs import GymWrapper, PettingZooWrapper, check_env_specs

    env = GymWrapper(team())
    check_env_specs(env)
    assert env.rollout(9).batch_size == (5,)
    env = PettingZooWrapper(agents(), use_mask=True, done_on_any=False)
    check_env_specs(env)
    flown = env.rollout(9)
    assert flown.batch_size == (5,) and flown["uav", "mask"].sum(dim=0).tolist() == [5, 2, 5]
