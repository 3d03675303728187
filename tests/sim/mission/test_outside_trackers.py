"""Trackers from outside fly: the page's, Stone Soup's, and those that end a run in one line."""

import os
import re
import shutil
import sys

import pytest
from helpers.pages import DOCS, ROOT, blocks
from helpers.processes import python

from planning.registry import DEFAULT_PLANNER
from sim.mission.trial import Trial
from sim.recording.archive import load
from sim.running.run import run
from sim.scenario.loading import load as load_scenario
from sim.study.tasks import task_of
from sim.study.trial import fly
from tracking.plugins.registry import InputError

PAGE = (DOCS / "how-to" / "trackers.md").read_text(encoding="utf-8")
NEAREST = next(content for language, content in blocks(PAGE) if language == "python")
SOUP = DOCS / "examples" / "soup"
SHORT = ("duration=1", "sensing.mode=ideal")
OPEN = ("duration=5", "sensing.mode=ideal", "trees.density=0")
MEAN, COVARIANCE = "t.belief.mean", "t.belief.covariance"


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Makes a module of the test's."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def make(name, text):
        (tmp_path / f"{name}.py").write_text(text)
        monkeypatch.delitem(sys.modules, name, raising=False)

    return make


def flown(folder, *overrides, planner="greedy"):
    """Recording and summary of a mission."""
    summary = run(Trial(load_scenario("forest", overrides), planner, 0), folder, video=False)
    return load(folder / "mission.npz"), summary


@pytest.mark.parametrize("name", ["mytracker:Nearest", "soup:SoupJPDA"])
def test_a_tracker_from_outside_keeps_all_people_of_an_open_scene(tmp_path, monkeypatch, module, name):
    module("mytracker", NEAREST)
    monkeypatch.syspath_prepend(str(SOUP))
    recording, summary = flown(tmp_path / "out", *OPEN, f"tracking.tracker={name}")
    assert summary["faults"] == [] and f'"tracker":"{name}"' in recording.scenario
    assert set(recording.track_ids.tolist()) == {0, 1, 2, 3} and recording.ospa[..., 0].max() < 1.5


def test_stone_soups_tracks_of_unknown_people_are_found(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(SOUP))
    name, unknown = "tracking.tracker=soup:SoupJPDA", "tracking.initial_tracks=none"
    recording, _ = flown(tmp_path / "out", *OPEN, name, unknown, "sensing.field_of_view=unlimited", planner="hover")
    assert len(set(recording.track_ids.tolist())) == 4 and recording.ospa[10:, :, 0].max() < 1.5


LACKING = """
class Half:
    tracks = ()

    def __init__(self, *given):
        self.step = self.coast = self.message = print


class Trackless:
    def __init__(self, *given):
        self.step = self.coast = self.message = self.accept = print


class Raising:
    def __init__(self, *given):
        raise ValueError("no table")
"""


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("jdpa", "tracking.tracker: 'jdpa' is unknown; allowed are jpda; did you mean jpda? (or package.module:Class)"),
        ("no_such_module:Mine", "tracking.tracker: 'no_such_module:Mine' cannot be imported: "),
        ("lacking:Hal", "tracking.tracker: 'lacking:Hal' cannot be imported: lacking has no class 'Hal'"),
        ("lacking:Half", "tracking.tracker: 'lacking:Half' has no method accept(message)"),
        ("lacking:Trackless", "tracking.tracker: 'lacking:Trackless' cannot give its tracks: AttributeError: "),
        ("lacking:Raising", "tracking.tracker: 'lacking:Raising' cannot be made: no table ("),
    ],
)
def test_what_is_no_tracker_is_refused_before_the_flight(tmp_path, module, name, complaint):
    module("lacking", LACKING)
    with pytest.raises(InputError, match=re.escape(complaint)) as error:
        scenario = load_scenario("forest", [*SHORT, f"tracking.tracker={name}"])
        run(Trial(scenario, DEFAULT_PLANNER, 0), tmp_path / "out", video=False)
    assert "\n" not in str(error.value) and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("call", "line", "complaint"),
    [
        ("step", f"for t in self.tracks: {MEAN}[:] = np.nan", "cannot give a message: "),
        ("accept", f"for t in self.tracks: {MEAN}[:] = np.nan", "give its tracks: means of tracks are not finite"),
        ("accept", f"for t in self.tracks: {COVARIANCE}[:] *= -1", "are not symmetric and positive definite"),
        ("accept", "self.tracks *= 2", "cannot give its tracks: ids of tracks are there twice: [0, 1, 2, 3]"),
        ("accept", "self.tracks = None", "cannot give its tracks: "),
        ("accept", "self.tracks = tuple(replace(t, existence=0.0) for t in self.tracks)", "existence of tracks is not"),
        ("accept", "self.tracks = tuple(replace(t, id=-t.id) for t in self.tracks)", "not whole numbers of at least 0"),
        ("accept", "raise KeyError('table')", "cannot accept a message: KeyError: 'table' ("),
        ("step", "raise SystemExit(3)", "cannot take a scan: SystemExit: 3 ("),
        ("coast", "1 / 0", "cannot take a scan: ZeroDivisionError: "),
        ("message", "return None", "cannot give a message: it is no tracking.fusion.message.Message but NoneType"),
        ("message", "return replace(given, ids=given.ids[::-1])", "cannot give a message: ids are not ascending"),
        ("message", "return replace(given, shares=given.shares[1:])", "shares of shape (3, 22), not (4, 22)"),
        ("message", "return replace(given, shares=0 * given.shares)", "are not positive"),
        ("message", "return replace(given, misses=given.misses / 2)", "misses are no table (4,) of whole numbers"),
        ("message", "return replace(given, partition=None)", "cannot give a message: partition are no"),
        ("message", "return replace(given, scan=None)", "scan are no table () of whole numbers"),
        ("message", "return replace(given, deleted=((1,),))", "deleted are no table (1, 2) of numbers"),
        ("message", "return replace(given, times=given.times + np.nan)", "times are no table (4, 3) of numbers"),
    ],
)
def test_nonsense_of_a_tracker_ends_the_run_in_one_line(tmp_path, module, call, line, complaint):
    argument = {"step": "scan", "coast": "time", "message": "degree", "accept": "message"}[call]
    code = f"class Wrong(Nearest):\n    def {call}(self, {argument}):\n"
    code += f"        given = super().{call}({argument})\n        {line}\n"
    module("wrong", f"{NEAREST}\n\n{code}")
    scenario = load_scenario("forest", [*SHORT, "tracking.tracker=wrong:Wrong"])
    with pytest.raises(InputError, match=re.escape(complaint)) as error:
        run(Trial(scenario, "hover", 0), tmp_path / "out", video=False)
    assert str(error.value).startswith("tracking.tracker: 'wrong:Wrong' ") and "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_a_tracker_that_changes_what_it_is_given_changes_nothing(module):
    module("mytracker", NEAREST)
    code = "class Spoils(Nearest):\n    def step(self, scan):\n        super().step(scan)\n"
    code += "        scan.measurements[:] = scan.pose.position[:] = np.nan\n"
    code += "    def accept(self, message):\n        super().accept(message)\n        message.ids[:] = 0\n"
    module("spoils", f"{NEAREST}\n\n{code}")
    recordings = []
    for name in ("mytracker:Nearest", "spoils:Spoils"):
        setting = load_scenario("forest", [*SHORT, f"tracking.tracker={name}"])
        recordings.append(fly(task_of(setting, "greedy", 0)).row)
    assert recordings[0].ospa.tobytes() == recordings[1].ospa.tobytes() and recordings[1].error == ""


@pytest.mark.docs
def test_the_example_passes_its_own_tests(tmp_path):
    shutil.copytree(SOUP, tmp_path / "soup")
    path = os.pathsep.join([str(tmp_path / "soup"), str(ROOT)])
    words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "tests"]
    done = python(*words, cwd=tmp_path / "soup", PYTHONPATH=path)
    assert "2 passed" in done.stdout, done.stdout
