"""Environments keep to Gymnasium's and PettingZoo's rules, fly what missions fly, and refuse wrong input."""

import copy
import itertools
import subprocess
import sys
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction, ResetNeeded, UnsupportedMode
from gymnasium.utils.env_checker import check_env, data_equivalence
from helpers.flights import fly
from helpers.teams import Spy
from pettingzoo.test import parallel_api_test, parallel_seed_test

import understory
from sim.mission import mission as mission_module
from sim.mission.archive import compute_digest
from sim.scenario.loading import SCENARIOS, load_scenario
from sim.world.trajectories import Trajectories
from tracking.errors import InputError

IDEAL = {"sensing.mode": "ideal", "dynamics": "kinematic", "duration": 4}
WORLDS = [pytest.param(name, {"duration": 4}, marks=pytest.mark.slow) for name in SCENARIOS]
UNBOUNDED = "ignore:.*Box observation space m.*imum value"


def test_gymnasium_finds_the_scenarios_in_any_order_of_imports(tmp_path):
    """In a new process that imports Gymnasium last; all other tests import it first. A look-up imports no packages."""
    script = "import understory, gymnasium; gymnasium.spec('understory/Search-v0')"
    script += "; gymnasium.make('understory:understory/Search-v0')"
    done = subprocess.run([sys.executable, "-W", "error", "-c", script], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def equal(one, other):
    return data_equivalence(one, other, exact=True)


@pytest.mark.filterwarnings("error", UNBOUNDED, "ignore:.*'options' is unknown")
@pytest.mark.parametrize(("name", "settings"), [("forest", IDEAL), ("paper", {"duration": 4}), *WORLDS])
def test_a_scenario_keeps_to_the_rules_of_gymnasium_and_pettingzoo(name, settings):
    check_env(gymnasium.make(f"understory/{name.capitalize()}-v0", settings=settings).unwrapped)
    parallel_api_test(understory.parallel_env(name, settings=settings))
    parallel_seed_test(lambda: understory.parallel_env(name, settings=settings))


@pytest.mark.filterwarnings("error", UNBOUNDED)
def test_a_team_that_renders_and_sees_keeps_to_the_rules():
    """One step less than the rules need to see how it ends is enough for the frames."""
    settings = {"duration": 3, "sensing.mode": "camera", "dynamics": "kinematic"}
    env = gymnasium.make("understory/Forest-v0", settings=settings, observe={"image": True}, render_mode="rgb_array")
    check_env(env.unwrapped, skip_render_check=True)
    observation, _ = env.reset(seed=1)
    assert observation["image"].shape == (3, 128, 128, 3) and observation["image"].std() > 1
    first = env.render()
    assert first.shape == (720, 1280, 3) and first.dtype == np.uint8 and np.array_equal(first, env.render())
    observation, *_ = env.step(np.ones((3, 2)))
    assert not np.array_equal(first, env.render())
    mission, _ = fly("dynamics=kinematic", planner=eastward(1.0, 1.0), seed=1, duration=1)
    assert np.array_equal(observation["image"], mission.images)


def eastward(east, north):
    """A planner that flies all UAVs with these shares of their limit."""
    share = np.array([[east, north]]) / max(1.0, np.hypot(east, north))
    return Spy(lambda situation: share * situation.own.max_speed)


def test_an_environment_flies_the_mission_of_its_seed_and_repeat():
    env = understory.parallel_env("forest", settings=IDEAL)
    env.reset(seed=3, options={"repeat": 2})
    while env.agents:
        env.step(dict.fromkeys(env.agents, np.array([0.5, -2.0], dtype=np.float32)))
    recording = env.flight().recording
    _, snapshots = fly(
        "sensing.mode=ideal", "dynamics=kinematic", planner=eastward(0.5, -1), seed=3, repeat=2, duration=4
    )
    assert (recording.seed, recording.repeat, recording.interrupted) == (3, 2, False)
    np.testing.assert_array_equal(recording.ospa, [snapshot.ospa for snapshot in snapshots])
    env.reset()
    env.step(dict.fromkeys(env.agents, np.zeros(2)))
    assert env.flight().recording.seed >= 2**32


def test_resets_without_a_seed_draw_new_maps_the_same_after_the_same_seed():
    drawn, expected = [], []
    for env in (understory.parallel_env("forest", settings={**IDEAL, "duration": 1}) for _ in range(2)):
        env.reset(seed=5)
        assert env.np_random_seed == 5
        for _ in range(2):
            expected.append(int(copy.deepcopy(env.np_random).integers(2**32, 2**63)))
            env.reset()
            env.step(dict.fromkeys(env.agents, np.zeros(2)))
            drawn.append(env.flight().recording.seed)
    assert drawn == expected and drawn[:2] == drawn[2:] and len(set(drawn)) == 2


def test_a_copy_of_an_environment_goes_on_as_it_does():
    env = understory.parallel_env("forest", settings={**IDEAL, "dynamics": "quadrotor"}, render_mode="rgb_array")
    env.reset(seed=2)
    given = dict.fromkeys(env.agents, np.array([0.4, -0.2]))
    env.step(given)
    env.render()
    other = copy.deepcopy(env)
    while env.agents:
        assert equal(env.step(given), other.step(given)) and np.array_equal(env.render(), other.render())
    assert compute_digest(env.flight().recording) == compute_digest(other.flight().recording)


def test_a_uav_that_breaks_down_is_terminated_and_the_others_are_truncated():
    settings = {**IDEAL, "uavs.0.fails_at": 0, "uavs.1.fails_at": 1.5}
    env = understory.parallel_env("forest", settings=settings)
    seen, _ = env.reset(seed=0)
    assert env.agents == ["uav_1", "uav_2"] == sorted(seen)
    ends = []
    while env.agents:
        last = seen
        seen, rewards, terminated, truncated, infos = env.step(dict.fromkeys(env.agents, np.zeros(2)))
        ends.append((terminated, truncated))
        if terminated.get("uav_1"):
            assert equal(seen["uav_1"], last["uav_1"]) and rewards["uav_1"] == 0.0 and set(infos["uav_1"]) == {"time"}
    on = {"uav_2": False}
    assert ends == [
        ({"uav_1": False, **on}, {"uav_1": False, **on}),
        ({"uav_1": True, **on}, {"uav_1": False, **on}),
        (on, on),
        (on, {"uav_2": True}),
    ]
    settings = {**IDEAL, **{f"uavs.{i}.fails_at": 1.5 for i in range(3)}}
    team = gymnasium.make("understory/Forest-v0", settings=settings)
    team.reset(seed=0)
    assert team.step(np.zeros((3, 2)))[2:4] == (False, False)
    observation, reward, terminated, truncated, _ = team.step(np.zeros((3, 2)))
    assert (reward, terminated, truncated) == (0.0, True, False) and not observation["working"].any()
    assert len(team.unwrapped.flight().recording.times) == 21


def test_a_teams_reward_and_infos_are_means_over_the_uavs_that_work():
    settings = {**IDEAL, "uavs.1.fails_at": 1.5, "network.rounds": 0}  # what UAVs believe differs
    team = gymnasium.make("understory/Forest-v0", settings=settings)
    each = understory.parallel_env("forest", settings=settings)
    team.reset(seed=0)
    each.reset(seed=0)
    while each.agents:
        _, reward, _, truncated, info = team.step(np.full((3, 2), 0.4))
        _, rewards, terminated, _, infos = each.step(dict.fromkeys(each.agents, np.full(2, 0.4)))
        working = [agent for agent, ends in terminated.items() if not ends]
        assert reward == pytest.approx(np.mean([rewards[agent] for agent in working]))
        assert info == pytest.approx({name: np.mean([infos[agent][name] for agent in working]) for name in info})
    assert truncated and working == ["uav_0", "uav_2"] and set(info) == {"time", "ospa", "gospa"}
    errors = each.flight().recording.ospa[-1, :, 0]
    assert errors[0] != errors[2] and [infos[agent]["ospa"] for agent in working] == errors[[0, 2]].tolist()


KNOWN = "gospa, true_gospa, trace"
TEAM = partial(gymnasium.make, "understory/Forest-v0")
# How the message begins, what is made, and of what.
REFUSED = [
    ("scenario: 'forst' is unknown; allowed are ", understory.parallel_env, {"scenario": "forst"}),
    (f"reward: 'gopsa' is unknown; allowed are {KNOWN}; did you mean gospa?", TEAM, {"reward": "gopsa"}),
    ("observe: 'image' is not allowed; expected a dict with keys of tracks, trees", TEAM, {"observe": "image"}),
    ("observe: image 1 is not allowed; expected True or False", TEAM, {"observe": {"image": 1}}),
    ("observe: there is no image with sensing.mode 'ideal'", TEAM, {"settings": IDEAL, "observe": {"image": True}}),
    ("duration: 0.5 s is too short; an episode needs two decisions", TEAM, {"settings": {"duration": 0.5}}),
]


@pytest.mark.parametrize(("message", "make", "options"), REFUSED, ids=[message for message, *_ in REFUSED])
def test_settings_that_cannot_be_used_are_refused_in_one_line(message, make, options):
    with pytest.raises(InputError) as refused:
        make(**options)
    assert str(refused.value).startswith(message) and "\n" not in str(refused.value)


def test_unknown_names_modes_and_repeats_are_refused():
    with pytest.raises(gymnasium.error.NameNotFound):
        gymnasium.make("understory/Forst-v0")
    with pytest.raises(UnsupportedMode, match="render_mode: 'human' is not allowed; expected None or 'rgb_array'"):
        understory.parallel_env(render_mode="human")
    env = understory.parallel_env("forest", settings=IDEAL)
    for repeat in (-1, 1.5, True, 10_000):
        with pytest.raises(InputError, match=f"repeat: {repeat} is not allowed; expected an integer, 0 to 9999"):
            env.reset(options={"repeat": repeat})


# Every way to fly a mission of a seed in this process.
SEEDED = {
    "run": lambda seed: understory.run("forest", "hover", seed=seed, settings=IDEAL),
    "mission": lambda seed: understory.mission("forest", seed=seed, settings=IDEAL),
    "Mission": lambda seed: understory.Mission(load_scenario("forest", ["sensing.mode=ideal"]), seed=seed),
    "parallel": lambda seed: understory.parallel_env("forest", settings=IDEAL).reset(seed=seed),
    "team": lambda seed: TEAM(settings=IDEAL).reset(seed=seed),
}


@pytest.mark.parametrize("way", SEEDED)
def test_seeds_are_the_same_integers_for_every_way_to_fly(way):
    for seed in (2**128, 2**130, -1, True, 1.5, "3", 3.0):
        with pytest.raises(InputError, match=r"^seed: .* is not allowed; expected an integer, 0 to 3402823669"):
            SEEDED[way](seed)
    for seed in (np.int64(3), 2**128 - 1):
        SEEDED[way](seed)


def test_a_refused_reset_leaves_episode_and_generator_alone():
    env, other = (understory.parallel_env("forest", settings=IDEAL) for _ in range(2))
    for each in (env, other):
        each.reset(seed=3)
        each.step(dict.fromkeys(each.agents, FINE))
    for wrong in ({"seed": True}, {"options": {"repeat": -1}}, {"options": {"settings": {"trees.densty": 3}}}):
        with pytest.raises(InputError):
            env.reset(**wrong)
    with pytest.raises(InputError, match=r"^options: settings of other area, uavs or pixels need an environment of"):
        env.reset(seed=0, options={"settings": {"area.width": 300}})
    given = dict.fromkeys(env.agents, FINE)
    assert equal(env.step(given), other.step(given)) and equal(env.reset(), other.reset())


def test_a_reward_that_sees_the_truth_is_marked_and_given_true_positions():
    asked = []

    def nearness(situation, people):
        asked.append(people)
        return float(situation.own.id)

    marks = {"gospa": False, "trace": False, "true_gospa": True, nearness: True}
    for reward, mark in marks.items():
        env = understory.parallel_env("forest", settings=IDEAL, reward=reward)
        assert env.metadata["reward_sees_truth"] == mark
        team = gymnasium.make("understory/Forest-v0", settings=IDEAL, reward=reward)
        assert team.unwrapped.metadata["reward_sees_truth"] == mark
    env.reset(seed=0)
    rewards = env.step(dict.fromkeys(env.agents, FINE))[1]
    assert rewards == {"uav_0": 0.0, "uav_1": 1.0, "uav_2": 2.0}
    env.step(dict.fromkeys(env.agents, FINE))
    np.testing.assert_array_equal(asked[0], env.flight().recording.people[5])


@pytest.mark.parametrize("given", [np.nan, -np.inf, None, "high", 10**400], ids=range(5))
def test_a_reward_that_is_no_finite_number_is_refused(given):
    env = understory.parallel_env("forest", settings=IDEAL, reward=lambda situation, people: given)
    env.reset(seed=0)
    with pytest.raises(InputError, match=f"reward: the function returned {given!r}; expected a finite number"):
        env.step(dict.fromkeys(env.agents, FINE))


FINE = np.zeros(2)
ACTIONS = {
    "action of UAV 1: of shape (3,) is not allowed; expected two numbers in [-1, 1]": {"uav_1": np.zeros(3)},
    "action of UAV 1: 'north' is not two numbers in [-1, 1]": {"uav_1": "north"},
    "actions: 'uav_7' is unknown; allowed are uav_0, uav_1, uav_2; did you mean uav_2?": {
        "uav_1": FINE,
        "uav_7": FINE,
    },
    "actions: that of uav_1 is missing; expected one of each of ['uav_0', 'uav_1', 'uav_2']": {},
}


def test_actions_that_cannot_be_used_are_refused_and_change_nothing():
    env, other = (understory.parallel_env("forest", settings=IDEAL) for _ in range(2))
    with pytest.raises(ResetNeeded, match="call reset first"):
        env.step({})
    env.reset(seed=0)
    other.reset(seed=0)
    for message, wrong in ACTIONS.items():
        with pytest.raises(InvalidAction) as refused:
            env.step({"uav_0": FINE, "uav_2": FINE, **wrong})
        assert str(refused.value).startswith(message)
    with pytest.raises(InvalidAction, match="actions: ndarray is not allowed; expected a dict by agent"):
        env.step(np.zeros((3, 2)))
    with pytest.raises(InvalidAction, match="actions: 0 is unknown; allowed are uav_0, uav_1, uav_2"):
        env.step({0: FINE})
    while env.agents:
        given = dict.fromkeys(env.agents, FINE)
        assert equal(env.step(given), other.step(given))
    with pytest.raises(ResetNeeded, match="the episode is over; call reset"):
        env.step(given)
    assert env.step({}) == ({}, {}, {}, {}, {})
    env.close()
    for late in (env.flight, env.render, lambda: env.step({})):
        with pytest.raises(ResetNeeded, match="call reset first"):
            late()
    team = gymnasium.make("understory/Forest-v0", settings=IDEAL, disable_env_checker=True)
    team.reset(seed=0)
    with pytest.raises(InvalidAction, match=r"action: of shape \(2,\), not \(3, 2\)"):
        team.step(FINE)
    assert team.render() is None


def test_an_image_is_the_last_that_a_slow_camera_took():
    rates = {"rates.sensing": 6, "rates.planning": 3, "uavs.0.rate": 2, "duration": 2}
    env = understory.parallel_env("forest", settings=rates, observe={"image": True})
    observations = env.reset(seed=1)[0]
    taken, images = [], [observations["uav_0"]["image"]]
    for _ in range(3):
        observations = env.step(dict.fromkeys(env.agents, FINE))[0]
        images.append(observations["uav_0"]["image"])
        taken.append(observations["uav_1"]["image"])
    # Decisions are at scans 0, 2, 4 and 6, frames of the first UAV at scans 0, 3 and 6.
    changed = [not np.array_equal(*pair) for pair in itertools.pairwise(images)]
    assert changed == [False, True, True] and not np.array_equal(taken[0], taken[1])


@pytest.mark.parametrize("settings", [IDEAL, {"duration": 2}], ids=["ideal", "rendered"])
def test_what_no_uav_can_know_changes_no_observation_reward_or_image(settings, monkeypatch):
    """People far from all cameras are moved; with unknown tracks nothing tells of them but the truth."""
    seen = {"image": settings.get("sensing.mode") != "ideal"}
    settings = {**settings, "tracking.initial_tracks": "none", "people.count": 5}
    made, chance, shown = mission_module.make_forest_and_people, np.random.default_rng(1), []
    place, places = np.zeros(2), set()

    def moved(scenario, seed):
        forest, people = made(scenario, seed)
        positions = people.positions.copy()
        positions[:, 4] = place + 0.01 * np.arange(len(positions))[:, None]
        return forest, Trajectories(people.times, positions)

    monkeypatch.setattr(mission_module, "make_forest_and_people", moved)
    for _ in range(2 if seen["image"] else 4):
        place[:] = chance.uniform((40.0, -45.0), (70.0, 45.0))  # UAVs begin at x = -28 m and fly 20 m at most
        env = understory.parallel_env("forest", settings=settings, observe=seen)
        told = [env.reset(seed=2)[0]]
        while env.agents:
            told.append(env.step(dict.fromkeys(env.agents, np.array([1.0, 0.3])))[:4])
        recording = env.flight().recording
        assert not recording.visible[..., 4].any()
        places.add(tuple(recording.people[0, 4]))
        shown.append(told)
    assert len(places) == len(shown)
    assert all(equal(one, other) for one in shown for other in shown)


def test_actions_of_uavs_that_have_broken_down_are_ignored():
    """Wrappers pass actions of all possible agents."""
    settings = {**IDEAL, "uavs.0.fails_at": 0, "uavs.1.fails_at": 1.5}
    env, other = (understory.parallel_env("forest", settings=settings) for _ in range(2))
    team, same = (TEAM(settings=settings, disable_env_checker=True) for _ in range(2))
    for each in (env, other, team, same):
        each.reset(seed=0)
    dead = {"uav_0"}
    while env.agents:
        given = dict.fromkeys(env.possible_agents, np.array([0.4, 0.1])) | dict.fromkeys(dead, np.array([np.nan, 7.0]))
        assert equal(env.step(given), other.step({agent: given[agent] for agent in other.agents}))
        rows = np.array(list(given.values()))
        assert equal(team.step(rows), same.step(np.nan_to_num(rows)))
        dead |= set(env.possible_agents) - set(env.agents)
    assert dead == set(env.possible_agents)


@pytest.mark.parametrize("scaled", [False, True])
def test_a_planner_observes_what_the_environments_show(scaled):
    settings, seen = {**IDEAL, "uavs.1.fails_at": 0}, {"tracks": 4, "trees": 3, "flat": True, "scaled": scaled}
    situations = understory.mission("forest", seed=1, settings=settings).team
    subject = understory.Observations(2, **seen)
    each, team = (
        understory.parallel_env("forest", settings=settings, observe=seen),
        TEAM(settings=settings, observe=seen),
    )
    told, vector = each.reset(seed=1)[0], team.reset(seed=1)[0]
    assert [s.own.id for s in situations] == [0, 2]
    for situation in situations:
        np.testing.assert_array_equal(subject.of(situation), told[f"uav_{situation.own.id}"])
    np.testing.assert_array_equal(subject.of_team(situations), vector)
    assert team.observation_space.contains(vector) and (np.abs(vector).max() <= 1.0) == scaled


def test_a_flat_observation_is_all_arrays_one_after_another_in_order_of_their_names():
    many, flat = (understory.parallel_env("forest", settings=IDEAL, observe={"flat": f}) for f in (False, True))
    for observations, vectors in [(many.reset(seed=1)[0], flat.reset(seed=1)[0])]:
        for agent, vector in vectors.items():
            parts = [array.ravel() for _, array in sorted(observations[agent].items())]
            np.testing.assert_array_equal(vector, np.concatenate(parts))
            assert flat.observation_space(agent).contains(vector)
    many, flat = (TEAM(settings=IDEAL, observe={"flat": f}) for f in (False, True))
    vector, observation = flat.reset(seed=1)[0], many.reset(seed=1)[0]
    np.testing.assert_array_equal(vector, np.concatenate([array.ravel() for _, array in sorted(observation.items())]))
    assert flat.observation_space.contains(vector) and vector.dtype == np.float32


def setting_of(*overrides):
    return load_scenario("forest", ["sensing.mode=ideal", "dynamics=kinematic", "duration=4", *overrides])


OWN = {"uavs.0.start": [5, -20], "trees.density": 3, "people.count": 2, "uavs.1.max_speed": 2.5}


@pytest.mark.parametrize("scenario", ["forest", load_scenario("forest")], ids=["name", "object"])
def test_an_episode_has_the_settings_of_its_reset_and_the_next_one_has_not(scenario):
    env, own = (understory.parallel_env(scenario, settings=IDEAL | more) for more in ({}, OWN))
    plain = digests = None
    for options in (None, {"settings": OWN}, None):
        for each in (env, own):
            each.reset(seed=3, options=options if each is env else None)
            while each.agents:
                each.step(dict.fromkeys(each.agents, np.array([1.0, 0.5])))
        digests = [compute_digest(each.flight().recording) for each in (env, own)]
        assert (digests[0] == digests[1]) == (options is not None)
        if options is None:
            assert env.flight().scenario == setting_of() and plain in (None, digests[0])
            plain = digests[0]
    team = TEAM(settings=IDEAL)
    team.reset(seed=3, options={"settings": OWN})
    team.step(np.zeros((3, 2)))
    assert team.unwrapped.flight().scenario == own.flight().scenario


def test_a_saved_episode_is_explained_replayed_and_exported(call, tmp_path):
    env = understory.parallel_env("forest", settings={**IDEAL, "uavs.1.fails_at": 1.5})
    env.reset(seed=2**100, options={"settings": {"people.count": 2}})
    for _ in range(3):
        env.step(dict.fromkeys(env.possible_agents, np.array([0.5, 0.0])))
    flight = env.flight()
    flight.save(tmp_path / "episode.npz")
    again = understory.load(tmp_path / "episode.npz")
    assert compute_digest(again.recording) == compute_digest(flight.recording) and again.recording.interrupted
    for arguments in (
        ("explain", "episode.npz", "--target", "1", "--time", "2", "--out", "explained.png"),
        ("replay", "episode.npz", "--page", "--out", "page.html"),
        ("export", "episode.npz", "--to", "csv", "--out", "tables"),
    ):
        code, _, err = call(*arguments)
        assert code == 0, err
        assert (tmp_path / arguments[-1]).exists()
    with pytest.raises(InputError, match=r"^path: .* cannot be written: No such file or directory$"):
        flight.save(tmp_path / "nowhere" / "episode.npz")


def boxes(space):
    return (
        [space] if isinstance(space, gymnasium.spaces.Box) else [box for each in space.values() for box in boxes(each)]
    )


def test_every_space_is_a_box_and_masks_are_zeros_and_ones():
    for env in (understory.parallel_env("forest", settings=IDEAL), TEAM(settings=IDEAL)):
        env.reset(seed=0)
        space = env.observation_space("uav_0") if hasattr(env, "possible_agents") else env.observation_space
        assert len(boxes(space)) == len(space)
        masks = {name: box for name, box in space.items() if name.endswith("_mask") or name == "working"}
        assert len(masks) >= 3
        for box in masks.values():
            assert box == gymnasium.spaces.Box(0, 1, box.shape, np.int8)


def test_an_option_that_is_unknown_is_told_of():
    with pytest.warns(UserWarning, match="'repaet' is unknown and has no effect; allowed are repeat, settings"):
        understory.parallel_env("forest", settings=IDEAL).reset(seed=0, options={"repaet": 1})
