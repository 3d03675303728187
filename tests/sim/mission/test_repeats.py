"""Repeats fly the map of a seed with another chance; the first repeat is what the seed alone gives."""

import json

import numpy as np
import pytest
from helpers.flights import mission_of, recorded

from sim.mission.archive import load_recording
from sim.mission.recorded_links import find_recorded_links
from sim.mission.world_setup import make_forest_and_people
from sim.scenario.loading import load_scenario
from sim.study.definition import adapt_study, read_study
from sim.study.trials import list_trials
from sim.world.appearance import sample_appearance

NOISY = ["sensing.mode=ideal", "trees.density=5", "network.loss=0.3", "wind.gust=0.5"]


def flown(repeat):
    return recorded(*NOISY, planner="sma-nbo(evaluations=64)", seed=7, duration=2, repeat=repeat)


@pytest.fixture(scope="module")
def recordings():
    return [flown(repeat) for repeat in (0, 1, 2)]


def test_repeats_share_forest_and_people_not_chance_which_replay_finds(recordings):
    first, *others = recordings
    for other in others:
        np.testing.assert_array_equal(other.trees, first.trees)
        np.testing.assert_array_equal(other.people, first.people)
        assert not np.array_equal(other.measurements[:10], first.measurements[:10])
        assert not np.array_equal(other.poses, first.poses)
    assert not np.array_equal(others[0].measurements[:10], others[1].measurements[:10])
    again = flown(2)
    assert again.measurements.tobytes() == others[1].measurements.tobytes()
    assert again.track_means.tobytes() == others[1].track_means.tobytes()
    lost = [np.array([links.lost for links in find_recorded_links(r)]) for r in recordings]
    assert not np.array_equal(lost[0], lost[1])
    forgotten = flown(0)
    np.testing.assert_array_equal(lost[0], np.array([links.lost for links in find_recorded_links(forgotten)]))


def test_a_map_is_what_the_seed_gives_and_looks_the_same():
    setting = load_scenario("forest", NOISY)
    forest, people = make_forest_and_people(setting, 7)
    mission = mission_of(setting, "hover", 7, 3)
    assert mission.forest.trees == forest.trees and mission.people.positions.tobytes() == people.positions.tobytes()
    setting = load_scenario("forest", ["appearance.randomise=true"])
    one, other = (sample_appearance(setting, 4, trees=3, people=2, repeat=repeat) for repeat in (0, 5))
    for name in set(type(one).__dataclass_fields__) - {"repeat"}:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    grey = np.full((8, 8, 3), 100, np.uint8)
    assert not np.array_equal(one.develop(grey, 0, 0.2), other.develop(grey, 0, 0.2))


def test_a_run_leaves_its_repeat_in_folder_recording_and_summary(call, tmp_path):
    settings = [word for setting in NOISY for word in ("--set", setting)]
    options = ["run", "--seed", "7", "--planner", "hover", "--no-video", "--duration", "1", *settings]
    code, out, _ = call(*options, "--repeat", "2")
    folder = tmp_path / "runs" / "forest-hover-seed7-repeat2"
    assert code == 0 and "hover, seed 7, repeat 2" in out and folder.is_dir()
    assert json.loads((folder / "summary.json").read_text())["repeat"] == 2
    assert load_recording(folder / "mission.npz").repeat == 2
    code, out, _ = call(*options, "--repeat", "0")
    plainly = tmp_path / "runs" / "forest-hover-seed7"
    assert code == 0 and plainly.is_dir() and "repeat" not in out
    assert call(*options, "--out", "plain")[0] == 0
    assert (plainly / "mission.npz").read_bytes() == (tmp_path / "plain" / "mission.npz").read_bytes()


def test_a_study_flies_all_maps_before_it_repeats_them(tmp_path):
    (tmp_path / "mine.toml").write_text('study = { planners = ["hover", "greedy"], seeds = "4,2", repeats = 2 }')
    study = read_study(str(tmp_path / "mine.toml"))
    order = [(t.repeat, t.seed, t.planner) for t in list_trials(study)]
    assert order == [(r, s, p) for r in (0, 1) for s in (4, 2) for p in ("hover", "greedy")]
    assert len({t.key for t in list_trials(study)}) == 8
    assert {t.repeat for t in list_trials(adapt_study(study, repeats=1))} == {0}
    once = list_trials(adapt_study(study, repeats=1))
    assert [t.key for t in once] == [t.key for t in list_trials(study)[:4]]
