"""What is installed, and commands in a folder with modules named like ours, which never shadow ours."""

import subprocess
import sys
import zipfile

import pytest
from helpers.processes import ROOT, python
from helpers.studies import Serial

OURS = ("planning", "tracking", "assets", "understory")
MINE = "from planning.baselines import Hover\n\n\nclass Mine(Hover):\n    pass\n"
# As a script and with `python -m`; the latter puts the current folder first on the import path.
COMMANDS = [["-c", "from sim.__main__ import main; main()"], ["-m", "sim"]]
INSTALLED = {"PYTHONPATH": "", "COLUMNS": "300"}  # not by a path that is set


BUILD = """
import sys
from importlib import import_module
from sim.scenario.text_files import tomllib
with open("pyproject.toml", "rb") as file:
    backend = import_module(tomllib.load(file)["build-system"]["build-backend"])
for kind in ("editable", "wheel"):
    getattr(backend, f"build_{kind}")(f"{sys.argv[1]}/{kind}")
"""


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """The wheels of an editable and of an ordinary installation, as installers ask for them."""
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("wheels")
    for kind in ("editable", "wheel"):
        (folder / kind).mkdir()
    done = python("-c", BUILD, folder)
    assert done.returncode == 0, done.stderr
    return [zipfile.ZipFile(next((folder / kind).iterdir())) for kind in ("editable", "wheel")]


def test_an_editable_installation_is_found_beside_folders_named_like_its_packages(wheels, tmp_path):
    """Folders without Python in them, as of data: the installation is on the path of a fresh interpreter."""
    editable, _ = wheels
    (site := tmp_path / "site").mkdir()
    editable.extractall(site)
    (here := tmp_path / "here").mkdir()
    for name in ("assets", "planning", "sim", "tracking"):
        (here / name).mkdir()
    code = f"import site; site.addsitedir({str(site)!r}); import planning, assets"
    done = python("-c", f"{code}; print(planning.__file__, assets.__file__)", cwd=here, **INSTALLED)
    places = [str(ROOT / name / "__init__.py") for name in ("planning", "assets")]
    assert (done.stdout.split(), done.stderr) == (places, "")


def test_a_wheel_holds_the_files_of_the_packages_and_nothing_else(wheels):
    _, wheel = wheels
    packages = ["assets", "planning", "sim", "tracking", "understory.py"]
    asked = ["git", "ls-files", "--cached", "--others", "--exclude-standard", *packages]
    listed = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a checkout")
    held = {name for name in wheel.namelist() if not name.startswith("understory-")}
    assert held == set(listed.stdout.split()) and "sim/study/report/page.css" in held


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
def test_a_mission_flies_in_a_folder_with_modules_named_like_ours_and_the_engine_says_nothing(folder, command):
    arguments = ["run", "--planner", "mine:Mine", "--duration", "0.2", "--set", "sensing.mode=ideal", "--no-video"]
    done = python(*command, *arguments, cwd=folder, **INSTALLED)
    assert (done.returncode, done.stderr) == (0, "") and "build time" not in done.stdout
    assert list(folder.glob("runs/*/mission.npz"))


def test_built_in_planners_are_ours_in_a_folder_with_files_of_their_modules(folder, call):
    for name in ("baselines", "composed", "oracle", "rivals/thompson"):
        (folder / "planning" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "planning" / f"{name}.py").write_text("raise RuntimeError('of the user')\n")
    for command in (["run", "--no-video"], ["compare", "--seeds", "0", "--planner", "greedy"], ["check-planner"]):
        planners = ("hover", "thompson", "oracle") if command[0] == "run" else ("hover",)
        for planner in planners:
            rest = [planner] if command[0] == "check-planner" else ["--duration", "0.2", "--planner", planner]
            code, out, err = call(*command, *rest, executor=Serial())
            assert (code, err) == (0, ""), out
    assert call("planners")[0] == 0


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
