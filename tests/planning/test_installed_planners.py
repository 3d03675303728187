"""Planners of other packages: the example that is installed and flown, and how broken ones are shown and refused."""

import json
import os
import shutil
import sys

import pytest
from helpers.commands import called
from helpers.processes import ROOT, python

from planning.catalogue import PLANNERS, PlannerSpec, find_planners, list_planners
from planning.planner_loading import load_planner
from sim.terminal import console

EXAMPLE = ROOT / "docs" / "examples" / "shepherd"
MODULES = {
    "fine.py": """from planning.planner import Plan
class Fine:
    '''Stays, and says so
    in two lines.'''
    def __init__(self, speed=0.5, name="x", turn=False, size=None):
        pass
    def plan(self, team, rng):
        return [Plan([[0.0, 0.0]]) for _ in team]
class Raising:
    def plan(self, team, rng): raise KeyError("gone")
class Faulty:
    def __init__(self): raise ValueError("no table")
class Streaming:
    async def plan(self, team, rng): yield None
""",
    "needy.py": "import torch_that_is_missing.nn\nclass Needy: pass\n",
    "partial.py": "from planning.planner import Plann\n",
    "raising.py": "raise RuntimeError('two\\nlines')\n",
}
POINTS = """[understory.planners]
fine = fine:Fine
needy = needy:Needy
raising = raising:X
classless = fine:Fin
moduleless = fin:Fine
bare = fine
hover = fine:Fine
"""


def package(folder, name="theirs", points=POINTS):
    """A package as pip leaves it in a folder: modules and metadata."""
    metadata = folder / f"{name}-1.2.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
    (metadata / "entry_points.txt").write_text(points)
    for file, text in MODULES.items():
        (folder / file).write_text(text)


@pytest.fixture
def call(tmp_path, monkeypatch, capsys, without_pictures):
    """The command line in this process, in a folder where a package is: exit code, standard output and error."""
    package(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    for name in MODULES:
        monkeypatch.delitem(sys.modules, name.removesuffix(".py"), raising=False)
    monkeypatch.setattr(console.console, "width", 300)
    find_planners.cache_clear()
    yield lambda *arguments: called(arguments, monkeypatch, capsys)
    find_planners.cache_clear()


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The folder of the example as pip installs it, without network."""
    folder = tmp_path_factory.mktemp("example")
    shutil.copytree(EXAMPLE, folder / "source")
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check", "--quiet"]
    done = python("-m", "pip", "install", *options, "--target", "site", "./source", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "site"


@pytest.fixture
def example(installed, call, monkeypatch):
    """The command line where the example is installed."""
    monkeypatch.syspath_prepend(installed)
    return call


def test_the_example_is_listed_and_flies(example, tmp_path, monkeypatch):
    code, out, err = example("planners")
    assert (code, err) == (0, "")
    lines = [line.strip() for line in out.splitlines()]
    theirs = lines.index("From understory-shepherd 0.1.0:")
    words = "Sequential NBO that lets nobody stray from the nearest camera."
    assert lines[theirs + 1].split(maxsplit=1) == ["shepherd", words]
    assert "shepherd       horizon=4, far=10.0" in lines
    options = ["--planner", "shepherd(far=5)", "--duration", "1", "--no-video", "--out", "flown"]
    assert example("run", *options)[0] == 0
    summary = json.loads((tmp_path / "flown" / "summary.json").read_text())
    assert summary["planner"] == "shepherd(far=5)" and summary["faults"] == []


@pytest.mark.docs
def test_the_example_passes_its_own_tests(installed, tmp_path):
    shutil.copytree(EXAMPLE / "tests", tmp_path / "tests")
    words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "tests"]
    done = python(*words, cwd=tmp_path, PYTHONPATH=os.pathsep.join(map(str, (installed, ROOT))))
    assert "2 passed" in done.stdout, done.stdout


def test_what_is_broken_is_listed_as_such_and_hides_nothing(call):
    code, out, err = call("planners")
    assert (code, err) == (0, "")
    listed = dict(line.split(maxsplit=1) for line in out.partition("From theirs 1.2:\n")[2].splitlines()[:7])
    raising = listed.pop("raising").strip()
    assert raising.startswith("cannot be used: RuntimeError: two lines (") and raising.endswith(":1, in <module>)")
    assert {name: meaning.strip() for name, meaning in listed.items()} == {
        "bare": "cannot be used: it names no class; write fine:Class",
        "classless": "cannot be used: fine has no class 'Fin'; did you mean Fine?",
        "fine": "Stays, and says so",
        "hover": "hidden: the name is that of a planner built in",
        "moduleless": "cannot be used: No module named 'fin'; did you mean fine?",
        "needy": "cannot be used: needy needs 'torch_that_is_missing', which is not installed: "
        "No module named 'torch_that_is_missing'",
    }
    lines = [line.split(maxsplit=1) for line in out.splitlines()]
    assert ["fine", "speed=0.5, name=x, turn=False, size=None"] in [[word.strip() for word in line] for line in lines]


REFUSED = {  # besides what tests/sim/cli/test_honest_mistakes.py lists, by the same loader
    "hoover": ["'hoover' is unknown", "did you mean hover?"],
    "needy": ["'needy' of theirs 1.2, 'needy:Needy', cannot be imported", "needy needs 'torch_that_is_missing'"],
    "fine.py:Fine": ["'fine.py' is not the name of a module; write fine:Fine\n"],
    "my-lab/fine.py:Fine": ["'my-lab/fine.py' is not the name of a module\n"],
    "fine:Streaming": ["plan of 'fine:Streaming' is async; it must be a plain method"],
    "fine:Faulty": ["'fine:Faulty' cannot be made: ValueError: no table (", "fine.py:12, in __init__)"],
    "fine:Fine(sped=1)": ["'fine:Fine' has no option 'sped'", "did you mean speed?"],
}


@pytest.mark.parametrize("planner", REFUSED)
def test_what_is_no_planner_is_refused_in_one_line(planner, call, tmp_path):
    before = {path for path in tmp_path.rglob("*") if "__pycache__" not in str(path)}
    code, out, line = call("check-planner", planner)
    assert (code, out) == (2, "") and line.startswith("understory: planner: ") and line.count("\n") == 1
    for words in REFUSED[planner]:
        assert words in line
    # The other commands refuse it alike; a run has code of others in a process of its own, which takes a second.
    if planner in ("hoover", "needy", "fine:Faulty"):
        assert call("run", "--planner", planner) == (code, out, line)
    assert call("compare", "--planner", planner) == (code, out, line)
    assert {path for path in tmp_path.rglob("*") if "__pycache__" not in str(path)} == before


def test_the_check_has_a_line_per_check_and_an_exit_code(call):
    code, out, err = call("check-planner", "fine(turn=True, speed=3)")
    *lines, last = out.splitlines()
    assert (code, err, last) == (0, "", "It conforms.")
    assert [line.split()[0] for line in lines].count("-") == 1 and "FAILED" not in out
    code, out, err = call("check-planner", "fine:Raising")
    *lines, last = out.splitlines()
    (failed,) = [line for line in lines if line.startswith("FAILED")]
    assert (code, err, last) == (1, "", f"1 of {len(lines)} checks failed, {len(lines) - 1} could not be tried")
    assert failed.startswith(f"FAILED  {'plans':<26}KeyError: 'gone' (") and failed.endswith(", in plan)")


def test_options_are_listed_once_for_each_class_and_upper_bounds_are_marked(monkeypatch):
    lines = list_planners()["Options, each with what it is if not given"]
    for name, spec in PLANNERS.items():
        like, _, different = lines.get(name, "").removeprefix("those of ").partition(", with ")
        assert like not in PLANNERS or PLANNERS[like].target == spec.target
        listed = different if like in PLANNERS else lines.get(name, "")
        for option, value in spec.options.items():
            usual = PLANNERS[like].options.get(option) if like in PLANNERS else None
            assert value == usual or f"{option}={value}" in listed.split(", ")
    changed = "visibility=nominal, evaluations=0, search=0.0, connectivity=0.0, cutoff=0.0"
    assert lines["sma-nbo"] == f"those of sma-nbo-gospa, with {changed}"
    assert lines["lawnmower"] == "pace=0.9"
    monkeypatch.setitem(PLANNERS, "seer", PlannerSpec("planning.baselines:Hover", {}, "sees all", upper_bound=True))
    assert list_planners()["Built in"]["seer"] == "sees all (upper bound: knows what no UAV can)"


def test_of_two_packages_with_one_name_the_first_flies(tmp_path, monkeypatch):
    for name, target in (("zeal", "planning.baselines:Greedy"), ("alpha", "planning.baselines:Hover")):
        (tmp_path / name).mkdir()
        package(tmp_path / name, name, f"[understory.planners]\nstill = {target}\n")
        monkeypatch.syspath_prepend(tmp_path / name)
    find_planners.cache_clear()
    try:
        assert load_planner("still") == load_planner("hover")
        groups = list_planners()
    finally:
        find_planners.cache_clear()
    assert groups["From alpha 1.2"] == {"still": "Stays where it is."}
    assert groups["From zeal 1.2"] == {"still": "hidden: the name is that of a planner of alpha 1.2"}
