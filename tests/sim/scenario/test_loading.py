"""Scenario files are read strictly; every mistake gives one clear line."""

from pathlib import Path

import pytest

from sim.scenario.errors import InputError
from sim.scenario.loading import SCENARIOS, load
from sim.scenario.scenario import Scenario
from sim.world.trajectories import read


def test_the_default_scenario_is_what_an_empty_file_gives(tmp_path):
    empty = tmp_path / "empty.toml"
    empty.write_text("")
    assert load(str(empty)) == load("forest") == Scenario()


@pytest.mark.parametrize("name", sorted(SCENARIOS))
def test_every_packaged_scenario_is_valid(name):
    assert load(name).duration > 0


def test_overrides_reach_every_level():
    scenario = load("forest", ["trees.density=75", "uavs.1.alpha=0.3", "dynamics=kinematic", "people.count=2"])
    assert scenario.trees.density == 75 and scenario.dynamics == "kinematic" and scenario.people.count == 2
    assert [u.alpha for u in scenario.uavs] == [0.1, 0.3, 0.12]


def test_a_trajectory_file_is_found_beside_its_scenario(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('[people]\ntrajectories = "walk.csv"\n')
    assert load(str(path)).people.trajectories == str(tmp_path / "walk.csv")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("trees.densty=3", ["trees.densty", "did you mean density"]),
        ("tree.density=3", ["tree", "did you mean trees"]),
        ("uavs.0.alhpa=1", ["uavs.0.alhpa", "did you mean alpha"]),
        ("uavs.0.fov_rad=1", ["uavs.0.fov_rad", "did you mean fov_deg"]),
        ("trees.density=-3", ["trees.density", "-3", ">= 0"]),
        ("trees.density=nan", ["trees.density", "nan", "finite"]),
        ("trees.density=many", ["trees.density", "'many'", "float"]),
        ("duration=inf", ["duration", "inf", "finite"]),
        ("duration=0", ["duration", "> 0"]),
        ("rates.sensing=7", ["rates", "240", "7"]),
        ("rates.planning=2", ["rates", "5", "2"]),
        ("first_decision=-1", ["first_decision", "-1", ">= 0"]),
        ("first_decision=0.4", ["first_decision: 0.4 s", "1 s between decisions", "nearest are 0 and 1"]),
        ("first_decision=41", ["first_decision: 41 s is after the duration of 40 s"]),
        ("first_decison=1", ["first_decison", "did you mean first_decision"]),
        ("dynamics=quad", ["dynamics", "quadrotor", "did you mean quadrotor"]),
        ("trees.canopy_base=9", ["canopy_base 9", "canopy_top 6"]),
        ("uavs.0.footprint=4", ["uavs.0", "altitude", "canopy_top"]),
        ("uavs.0.start=[500, 0]", ["uavs.0.start", "outside"]),
        ("uavs=[{start=[0, 0]}, {start=[0.5, 0]}]", ["uavs.1.start", "[0.5, 0.0]", "1 m from uavs.0"]),
        ("uavs.7.alpha=1", ["'7'", "0 to 2"]),
        ("uavs=[]", ["uavs", "length >= 1"]),
        ("tracking.confirm=[4, 3]", ["confirm", "4 of 3"]),
        ("people.min_speed=5", ["min_speed 5", "max_speed 3"]),
        ("duration.x=3", ["duration", "no keys"]),
        ("version=2", ["version", "2"]),
        ("nonsense", ["key=value"]),
    ],
)
def test_a_wrong_value_is_named_in_one_line(override, words):
    with pytest.raises(ValueError) as caught:
        load("forest", [override])
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("name", ["forrest", "missing.toml", "/"])
def test_an_unknown_scenario_is_refused(name):
    with pytest.raises(ValueError, match="scenario"):
        load(name)


def test_a_broken_file_is_refused(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text("duration = = 3")
    with pytest.raises(ValueError, match=r"broken\.toml"):
        load(str(path))


def test_a_trajectory_file_that_links_to_itself_is_refused_where_it_is_read(tmp_path):
    (tmp_path / "walk.csv").symlink_to("walk.csv")
    scenario = load("forest", [f'people.trajectories="{tmp_path / "walk.csv"}"'])
    with pytest.raises(InputError, match="symbolic links"):
        read(Path(scenario.people.trajectories), scenario.area, duration=1.0)
