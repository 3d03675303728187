"""The state is the truth as the recording has it, in an order of its own, with zeros for what is not there."""

import gymnasium
import numpy as np
import pytest

import understory
from sim.facts.metrics.score import estimate_velocities
from tracking.errors import InputError

SETTINGS = {"sensing.mode": "ideal", "dynamics": "kinematic", "duration": 4, "uavs.1.fails_at": 1.5}
STEP = np.array([0.5, -0.2])


def split(state, uavs):
    """Time, UAVs (n, 6) and people (M, 5)."""
    return state[0], state[1 : 1 + 6 * uavs].reshape(-1, 6), state[1 + 6 * uavs :].reshape(-1, 5)


def test_the_state_is_the_recorded_truth_in_both_front_ends():
    env = understory.parallel_env("forest", settings=SETTINGS)
    team = gymnasium.make("understory/Forest-v0", settings=SETTINGS, disable_env_checker=True).unwrapped
    env.reset(seed=3)
    team.reset(seed=3)
    states = [env.state()]
    while env.agents:
        env.step(dict.fromkeys(env.possible_agents, STEP))
        team.step(np.tile(STEP, (3, 1)))
        states.append(env.state())
        np.testing.assert_array_equal(team.state(), states[-1])
    assert env.metadata["state_sees_truth"] and team.metadata["state_sees_truth"]
    recording = env.flight().recording
    moved = estimate_velocities(recording)
    for k, state in zip(range(0, 21, 5), states, strict=True):
        assert env.state_space.contains(state)
        time, uavs, people = split(state, 3)
        assert time == recording.times[k]
        np.testing.assert_allclose(uavs[:, :3], recording.poses[k, :, :3], rtol=1e-6)
        assert uavs[:, 5].tolist() == recording.working[k].tolist()
        flown = recording.working[k][:, None] * (5 * STEP if k else 0 * STEP)
        np.testing.assert_allclose(uavs[:, 3:5], flown, rtol=1e-6)
        np.testing.assert_allclose(people[:, :2], recording.people[k], rtol=1e-6)
        np.testing.assert_allclose(people[:, 2:4], moved[k], atol=0.5)  # over two scans instead of one
        assert np.all(people[:, 4] == 1.0)


def test_people_who_are_absent_are_zeros_and_more_than_the_scenario_has_are_refused(tmp_path):
    env = understory.parallel_env("forest", settings=SETTINGS)
    env.reset(seed=3, options={"settings": {"people.count": 2}})
    people = split(env.state(), 3)[2]
    assert people[:, 4].tolist() == [1, 1, 0, 0] and not people[2:].any()
    env.reset(seed=3, options={"settings": {"people.count": 9}})
    with pytest.raises(InputError, match=r"^state: has no room for 9 people; make the environment with as many$"):
        env.state()
    (tmp_path / "people.csv").write_text("time,id,x,y\n0,a,0,0\n9,a,9,0\n2,b,5,5\n9,b,5,9\n0,c,3,0\n0.5,c,3,1\n")
    settings = {**SETTINGS, "people.trajectories": str(tmp_path / "people.csv")}
    env = understory.parallel_env("recorded", settings=settings)
    env.reset(seed=0)
    env.step(dict.fromkeys(env.agents, STEP))
    people = split(env.state(), len(env.possible_agents))[2]
    np.testing.assert_allclose(people, [[1, 0, 1, 0, 1], [0] * 5, [0] * 5], atol=1e-6)
