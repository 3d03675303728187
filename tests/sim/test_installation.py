"""Commands in a folder with modules named like ours: these never shadow ours, and a clash is said in one line."""

import sys

import pytest
from helpers.processes import python

OURS = ("planning", "tracking", "assets", "understory")
MINE = "from planning.baselines import Hover\n\n\nclass Mine(Hover):\n    pass\n"
# As a script and with `python -m`; the latter puts the current folder first on the import path.
COMMANDS = [["-c", "from sim.__main__ import main; main()"], ["-m", "sim"]]
INSTALLED = {"PYTHONPATH": "", "COLUMNS": "300"}  # not by a path that is set


@pytest.fixture
def folder(tmp_path):
    """A folder with a file or a package of each of our names, which fail when they are imported."""
    for name in OURS:
        (tmp_path / f"{name}.py").write_text(f"raise RuntimeError('the {name} of the user')\n")
    (tmp_path / "sim").mkdir()  # with a module sim.py there, `python -m sim` would be the user's
    (tmp_path / "random.py").write_text("raise RuntimeError('random of the user')\n")
    (tmp_path / "mine.py").write_text(MINE)
    return tmp_path


@pytest.mark.parametrize(
    "command", [pytest.param(COMMANDS[0], marks=pytest.mark.slow), COMMANDS[1]], ids=["script", "module"]
)
def test_a_mission_flies_in_a_folder_with_modules_named_like_ours(folder, command):
    arguments = ["run", "--planner", "mine:Mine", "--duration", "0.2", "--set", "sensing.mode=ideal", "--no-video"]
    done = python(*command, *arguments, cwd=folder, **INSTALLED)
    assert done.returncode == 0, done.stderr
    assert list(folder.glob("runs/*/mission.npz"))


@pytest.mark.parametrize("name", ["assets", "random"])
def test_a_plug_in_named_like_another_module_is_refused_in_one_line(folder, refused, name):
    (folder / f"{name}.py").write_text(MINE)
    line = refused("run", "--planner", f"{name}:Mine")
    owner = "Python" if name == "random" else "Understory"
    assert f"'{name}' is a module of {owner}, which hides that of the current folder; rename yours" in line


@pytest.mark.parametrize("name", ["sim.py", "tracking.py", "planning/__init__.py"])
def test_the_python_interface_names_the_file_that_hides_a_package(tmp_path, name):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("")
    done = python("-c", "import understory", cwd=tmp_path, **INSTALLED)
    *_, line = done.stderr.strip().splitlines()
    package = name.partition("/")[0]
    hidden = package.removesuffix(".py")
    assert line == f"ImportError: understory: {tmp_path / package} hides Understory's package {hidden!r}; rename it"


def test_a_plug_in_that_imports_a_hidden_module_is_refused_in_one_line(folder, refused, monkeypatch):
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    (folder / "mine.py").write_text("from assets import speed\n")
    line = refused("run", "--planner", "mine:Mine")
    assert "cannot import name 'speed' from 'assets'" in line
    assert "Understory's packages hide those in the current folder of the names" in line
