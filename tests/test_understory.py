"""The public Python API: what it names is there, and missions and comparisons fly by it as by the command line."""

import dataclasses
import importlib
import inspect
import re
import runpy
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import count

import numpy as np
import pytest
from helpers.commands import called

import understory
from sim.mission.archive import compute_digest
from sim.scenario.environment import People, Trees
from sim.scenario.scenario import Scenario, encode_scenario
from sim.scenario.sensing import Sensing
from sim.scenario.uavs import Uav

SHORT = {"duration": 1, "sensing.mode": "ideal"}


def test_every_name_has_a_docstring():
    for name in understory.__all__:
        assert getattr(understory, name).__doc__, name


def test_help_tells_the_meaning_of_every_field():
    """Of `Composed` the options stand in the reference of planners."""
    for name in set(understory.__all__) - {"Composed"}:
        kind = getattr(understory, name)
        if dataclasses.is_dataclass(kind) or hasattr(kind, "_fields"):
            own = [field for field in inspect.get_annotations(kind) if not field.startswith("_")]
            section = inspect.getdoc(kind).partition("Attributes:\n")[2].partition("\n\n")[0]
            assert re.findall(r"^    (\w+): \S", section, flags=re.M) == own, name


def test_a_gymnasium_that_cannot_be_imported_is_no_obstacle(tmp_path, monkeypatch):
    (tmp_path / "gymnasium.py").write_text("raise ImportError('built for another NumPy')\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("gymnasium", "sim.environments.registration"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    assert runpy.run_path(understory.__file__)["Plan"] is understory.Plan
    with pytest.raises(ImportError, match="built for another NumPy"):
        importlib.import_module("gymnasium")


@pytest.mark.parametrize("library", ["gymnasium", "pettingzoo"])
def test_an_environment_without_its_library_names_it(library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(understory.InputError, match=f"^{library} is not installed; environments need: pip install"):
        understory.parallel_env()


def test_a_run_is_the_mission_that_the_command_flies(tmp_path, monkeypatch, capsys, without_pictures):
    monkeypatch.chdir(tmp_path)
    flight = understory.run(planner="greedy", seed=2, settings={**SHORT, "trees": {"density": 5.0}})
    options = ["--set", "sensing.mode=ideal", "--set", "trees.density=5", "--duration", "1", "--no-video"]
    assert called(["run", "--planner", "greedy", "--seed", "2", *options, "--out", "one"], monkeypatch, capsys)[0] == 0
    again = understory.load("one")
    assert compute_digest(flight.recording) == compute_digest(again.recording)
    assert {path.name for path in tmp_path.iterdir()} == {"one"}


def test_a_run_takes_a_planner_that_is_an_object_and_a_scenario():
    class Still:
        """No UAV moves."""

        def plan(self, team, rng):
            return [understory.Plan(np.zeros((1, 2))) for _ in team]

    flight = understory.run(understory.Scenario(duration=0.4), Still())
    assert flight.recording.planner.endswith("Still") and isinstance(flight.scenario, Scenario)
    assert not flight.recording.commands.any()


def test_a_run_leaves_the_files_of_the_command_in_a_new_folder(tmp_path, without_pictures):
    flight = understory.run(planner="hover", settings=SHORT, out=tmp_path / "new")
    files = {path.name for path in (tmp_path / "new").iterdir()}
    assert {"mission.npz", "mission.mp4", "mission.html", "summary.json"} <= files
    assert len(flight.recording.times) == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"settings": {"trees.densty": 3}}, "trees.densty: unknown key"),
        ({"planner": object(), "out": "new"}, "out: not allowed with a planner that is an object"),
        ({"scenario": Scenario(trees=Trees(density=-4))}, "trees.density: -4 is not allowed; expected `float` >= 0"),
        (
            {"scenario": Scenario(people=People(stay=object))},
            "scenario: <class 'object'> is not allowed; expected plain values",
        ),
        ({"planner": 3}, r"planner: 'int' has no method plan\(team, rng\)"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_line(arguments, message):
    with pytest.raises(understory.InputError, match=f"^{message}"):
        understory.run(**arguments)
    if "out" not in arguments:
        with pytest.raises(understory.InputError, match=f"^{message}"):
            understory.mission(**arguments)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("duration = -4", "duration: -4 is not allowed; expected `float` > 0.0"),
        ("trees.density = 160", "trees.density = 160: this seed asks for 160, and only"),
    ],
)
def test_what_is_wrong_in_a_scenario_file_is_refused_with_its_name(content, message, tmp_path):
    path = tmp_path / "wood.toml"
    path.write_text(content)
    for fly in (understory.run, understory.mission, lambda name: understory.parallel_env(name).reset(seed=0)):
        with pytest.raises(understory.InputError, match=f"^{path}: {message}"):
            fly(path)
    with pytest.raises(
        understory.InputError, match=r"with other settings: trees\.densty: unknown key"
    ):  # not the file's own error
        understory.mission(path, settings={content.split(" = ")[0]: 1, "trees.densty": 3})
    settings = {"trees.density": 170}
    if "trees" in content:
        with pytest.raises(understory.InputError, match=rf"^{path} with other settings: trees\.density = 170: "):
            understory.mission(path, settings=settings)


def test_an_error_of_a_planner_names_no_scenario_file(tmp_path):
    class Secretive:
        def plan(self, team, rng):
            return []

        def knowing(self, people):
            raise RuntimeError("secret")

    path = tmp_path / "wood.toml"
    path.write_text("trees.density = 0")
    for fly in (understory.run, understory.mission):
        with pytest.raises(understory.InputError, match=r"^planner: '.*Secretive' cannot be given the truth by"):
            fly(path, planner=Secretive())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"planners": [object]}, "planners: .*<class 'object'>.* is not allowed; expected text"),
        ({"seeds": "0-9"}, r"seeds: '0-9' is not allowed; expected several integers, such as range\(10\)"),
        ({"seeds": [True]}, "seed: True is not allowed; expected an integer, 0 to 3402823669"),
        ({"seeds": count()}, "seeds: .* at most 100000 are allowed"),
        ({"workers": -1}, "workers: -1 is not allowed; expected an integer, 1 to 1024"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_one_line(arguments, message):
    with pytest.raises(understory.InputError, match=f"^{message}"):
        understory.compare(**{"planners": "hover", "settings": SHORT, **arguments})


@pytest.mark.parametrize("check", [understory.check_detector, understory.check_tracker])
def test_a_class_in_place_of_its_name_is_refused_in_one_line(check):
    with pytest.raises(understory.InputError, match=r": <class 'dict'> is not allowed; expected text, a name or"):
        check(dict)


def test_a_scenario_made_in_python_is_that_of_the_command():
    start = np.array([0.0, 1.0])
    made = understory.mission(Scenario(duration=np.float64(1), uavs=[Uav(start=start)], sensing=Sensing(mode="ideal")))
    given = understory.mission(settings={**SHORT, "uavs": [{"start": start}]})
    assert made.scenario == given.scenario and encode_scenario(made.scenario) == encode_scenario(given.scenario)


def test_a_comparison_is_a_frame_of_planners_by_scenarios_by_maps(tmp_path):
    other = tmp_path / "other.toml"
    other.write_text("trees.density = 5")
    scenarios = ["forest", str(other)]
    with ThreadPoolExecutor(1) as executor:
        table = understory.compare(["hover", "greedy"], scenarios, seeds=range(2), settings=SHORT, executor=executor)
    assert len(table) == 8 and set(table["status"]) == {"done"}
    assert table.groupby(["planner", "factor.scenario"]).size().tolist() == [2] * 4
    assert table["ospa.mean_m"].notna().all()
    alone = understory.run("forest", "greedy", seed=1, settings=SHORT)
    (row,) = table[(table.planner == "greedy") & (table.scenario == "forest") & (table.seed == 1)].to_dict("records")
    assert row["recording"] == compute_digest(alone.recording)


def test_what_a_comparison_varies_is_a_column():
    vary = {"fleet.size": range(1, 3), "network.loss": [0.5]}
    with ThreadPoolExecutor(1) as executor:
        table = understory.compare("hover", seeds=[4], settings=SHORT, vary=vary, executor=executor)
    assert list(table["factor.fleet.size"]) == ["1", "2"] and set(table["factor.network.loss"]) == {"0.5"}
    for size, recording in enumerate(table["recording"], start=1):
        settings = {**SHORT, "fleet.size": size, "network.loss": 0.5}
        assert recording == compute_digest(understory.run(planner="hover", seed=4, settings=settings).recording)


def test_an_export_is_that_of_the_command_and_only_images_take_several_flights(tmp_path, monkeypatch, capsys):
    flight = understory.run(planner="hover", settings=SHORT)
    flight.save(tmp_path / "flown.npz")
    understory.export(flight, "csv", tmp_path / "python")
    words = ["export", str(tmp_path / "flown.npz"), "--to", "csv", "--out", str(tmp_path / "command")]
    assert called(words, monkeypatch, capsys)[0] == 0
    for path in (tmp_path / "command").iterdir():
        assert path.read_bytes() == (tmp_path / "python" / path.name).read_bytes()
    tracked = understory.track(tmp_path / "python")
    for flights, to, message in (
        ([flight, flight], "mot", "flights: 2 are given; mot takes one"),
        (flight, "cocoa", "to: 'cocoa' .*coco"),
        ([flight, tracked], "coco", "flights: one was not flown here"),
    ):
        with pytest.raises(understory.InputError, match=f"^{message}"):
            understory.export(flights, to, tmp_path / "none")
    assert not (tmp_path / "none").exists()
