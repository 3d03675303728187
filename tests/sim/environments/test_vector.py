"""A vector environment shows what single environments show, in processes that leave nothing behind."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode

import understory  # noqa: F401 - registers the environments
from sim.environments.vector import TeamVectorEnv
from tracking.errors import InputError

IDEAL = {"sensing.mode": "ideal", "dynamics": "kinematic", "duration": 3}
NAME = "understory/Forest-v0"


@pytest.fixture
def make():
    """Makes vector environments, and closes them after the test without a process left."""
    made = []

    def make_one(number, **kwargs):
        made.append(TeamVectorEnv(number, **{"processes": 2, "settings": IDEAL, **kwargs}))
        return made[-1]

    yield make_one
    for envs in made:
        envs.close()
    assert not multiprocessing.active_children()


def draw_actions(number, k):
    return np.random.default_rng(k).uniform(-1.0, 1.0, (number, 3, 2)).astype(np.float32)


@pytest.mark.parametrize("mode", [*AutoresetMode])
@pytest.mark.parametrize("observe", [{}, {"flat": True}], ids=["arrays", "flat"])
def test_it_gives_what_gymnasiums_vector_of_single_environments_gives(mode, observe, make):
    """To the bit, over the ends of episodes."""
    given = {"settings": IDEAL, "observe": observe}
    envs = make(3, autoreset_mode=mode, **given)
    single = gymnasium.make_vec(NAME, 3, "sync", {"autoreset_mode": mode}, **given)
    assert envs.metadata == single.metadata and envs.metadata["autoreset_mode"] is mode
    for name in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        assert getattr(envs, name) == getattr(single, name)
    answers, ended = [each.reset(seed=7) for each in (envs, single)], np.zeros(3, dtype=np.bool_)
    for k in range(11):
        assert data_equivalence(*answers, exact=True) and envs.observation_space.contains(answers[0][0])
        if k == 1 or (mode is AutoresetMode.DISABLED and ended.any()):
            mask = np.arange(3) == 1 if k == 1 else ended
            given = {"seed": [None, 2**40, None] if k == 1 else None}
            answers = [each.reset(**given, options={"reset_mask": mask.copy()}) for each in (envs, single)]
            ended = ended & False
        else:
            answers = [each.step(draw_actions(3, k)) for each in (envs, single)]
            ended = answers[0][2] | answers[0][3]
    single.close()


def test_a_single_environment_of_the_same_seed_shows_the_same(make):
    envs, one = make(3), gymnasium.make(NAME, settings=IDEAL)
    observations, infos = envs.reset(seed=[5, 6, 7])
    expected, info = one.reset(seed=6)
    for k in range(3):
        assert data_equivalence({name: array[1] for name, array in observations.items()}, expected, exact=True)
        assert info == {name: infos[name][1] for name in info}
        actions = draw_actions(3, k)
        observations, rewards, _, truncated, infos = envs.step(actions)
        expected, reward, _, over, info = one.step(actions[1])
        assert rewards[1] == reward and truncated.tolist() == [over] * 3


def test_make_vec_finds_it_and_makes_a_process_a_core():
    envs = gymnasium.make_vec("understory/Paper-v0", 3, settings=IDEAL)
    assert isinstance(envs, TeamVectorEnv) and envs.spec.id == "understory/Paper-v0"
    assert len(multiprocessing.active_children()) == min(3, len(os.sched_getaffinity(0)))
    envs.close()
    envs.close()
    assert not multiprocessing.active_children()


def test_observations_are_copies_unless_the_shared_arrays_are_asked_for(make):
    copied, shared = make(2), make(2, copy=False)
    for envs, kept in ((copied, True), (shared, False)):
        first, _ = envs.reset(seed=1)
        before = first["own"].copy()
        second, *_ = envs.step(draw_actions(2, 1))
        assert np.array_equal(first["own"], before) == kept and not np.array_equal(second["own"], before)


def test_methods_are_called_in_each_environment(make):
    envs = make(3, render_mode="rgb_array")
    envs.reset(seed=3)
    envs.step(draw_actions(3, 0))
    assert [flight.recording.seed for flight in envs.call("flight")] == [3, 4, 5]
    assert [frame.shape for frame in envs.render()] == [(720, 1280, 3)] * 3 and envs.render_mode == "rgb_array"
    assert envs.get_attr("render_mode") == ("rgb_array",) * 3


def test_an_error_in_an_environment_is_raised_as_it_is_and_a_reset_goes_on(make):
    envs = make(3)
    envs.reset(seed=0)
    actions = draw_actions(3, 0)
    actions[2, 1] = np.nan
    with pytest.raises(gymnasium.error.InvalidAction, match=r"^action of UAV 1: \[nan, nan\] is not allowed") as caught:
        envs.step(actions)
    assert "in step" in str(caught.value.__cause__)
    again, _ = envs.reset(seed=0)
    assert data_equivalence(again, envs.reset(seed=0)[0], exact=True)


def raise_strange(situation, people):
    class Strange(Exception):
        """It cannot be sent to another process."""

    raise Strange("strange")


def test_an_error_that_cannot_be_sent_is_told_as_text(make):
    envs = make(1, reward=raise_strange)
    envs.reset(seed=0)
    with pytest.raises(RuntimeError, match=r"^Strange\('strange'\)$"):
        envs.step(draw_actions(1, 0))


def test_a_process_that_dies_is_one_error_and_closes_all(make):
    envs = make(4)
    envs.reset(seed=0)
    os.kill(envs._workers[1]._process.pid, signal.SIGKILL)
    with pytest.raises(
        gymnasium.error.Error, match=r"^the process of environments 2 to 3 was killed by SIGKILL; all are closed$"
    ):
        envs.step(draw_actions(4, 0))
    assert envs.closed and not multiprocessing.active_children()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        envs.reset()


def test_processes_end_with_the_one_that_made_them(tmp_path):
    """The script has no guard for processes that import it."""
    script = tmp_path / "train.py"
    script.write_text(
        "import gymnasium, multiprocessing, os, signal, understory\n"
        f"envs = gymnasium.make_vec('{NAME}', 2, processes=2, settings={IDEAL})\n"
        "print(*(child.pid for child in multiprocessing.active_children()), flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True)
    children = list(map(int, done.stdout.split()))
    assert len(children) == 2 and done.stderr == ""
    end = time.monotonic() + 30.0
    while any(map(is_running, children)):
        assert time.monotonic() < end
        time.sleep(0.05)


def is_running(process):
    try:
        os.kill(process, 0)
        return "State:\tZ" not in Path(f"/proc/{process}/status").read_text()  # dead, though nobody has asked for it
    except OSError:
        return False


def test_wrong_arguments_are_refused_before_a_process_starts(make):
    for kwargs, text in (
        ({"number": 0}, "num_envs: 0 is not allowed; expected a whole number of at least 1"),
        ({"number": 2, "processes": 0.5}, "processes: 0.5 is not allowed; expected a whole number of at least 1"),
        ({"number": 2, "observe": {"trees": 0}}, "observe: trees 0 is not allowed; expected an integer, 1 to 10000"),
    ):
        with pytest.raises(InputError, match=f"^{text}"):
            make(**kwargs)
    assert not multiprocessing.active_children()
    envs = make(2)
    with pytest.raises(InputError, match=r"^seed: 1 seeds are given; expected one for each of 2 environments$"):
        envs.reset(seed=[1])
    with pytest.raises(InputError, match=r"^options: reset_mask .* is not allowed; expected 2 flags"):
        envs.reset(options={"reset_mask": np.zeros(2, dtype=np.bool_)})
    with pytest.raises(gymnasium.error.InvalidAction, match=r"^actions: of shape \(1, 3, 2\), not \(2, 3, 2\)$"):
        envs.step(draw_actions(1, 0))
