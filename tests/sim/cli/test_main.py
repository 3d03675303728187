"""The command line: what it answers, and how it refuses wrong input."""

import errno
import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from helpers.commands import called

from planning.registry import PLANNERS
from sim.__main__ import COMMANDS
from sim.scenario.loading import SCENARIOS
from sim.terminal import console

ROOT = Path(__file__).parents[3]
PLANNER = """
class Wrong:
    def __init__(self):
        raise ValueError("a fault of the program, not of its user")
"""


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """Calls the command line in an empty folder of its own: exit code, standard output and standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(console.console, "width", 80)

    def run(*arguments):
        return called([*arguments], monkeypatch, capsys)

    return run


BROKEN = {
    "broken.toml": "duration = = 3",
    "nocsv.toml": '[people]\ntrajectories = "nope.csv"',
    "badcsv.toml": '[people]\ntrajectories = "bad.csv"',
    "bad.csv": "t,id,x,y\n0,1,0,zero\n1,1,1,1\n",
    "binary.toml": b"\xff\xfe\x00",
    "full/summary.json": "{}",
    "other/file": "",
}
WRONG = {
    "unknown command": (["flyy"], ["'flyy'", "run, compare, frames, replay, explain, export, planners, scenarios"]),
    "misspelt command": (["rum"], ["'rum'", "did you mean run?"]),
    "unknown option": (["run", "--sead", "3"], ["--sead", "--seed"]),
    "extra argument": (["run", "forest", "grove"], ["grove"]),
    "option without value": (["run", "--out"], ["--out"]),
    "unknown scenario": (["run", "forrest"], ["scenario", "'forrest'", "did you mean forest?"]),
    "missing file": (["run", "missing.toml"], ["scenario", "missing.toml"]),
    "broken TOML": (["run", "broken.toml"], ["broken.toml", "line 1"]),
    "no text": (["run", "binary.toml"], ["binary.toml"]),
    "folder as file": (["run", "full"], ["scenario", "'full'"]),
    "missing CSV": (["run", "nocsv.toml"], ["people.trajectories", "nope.csv", "No such file"]),
    "broken CSV": (["run", "badcsv.toml"], ["bad.csv, line 2, column y", "'zero'"]),
    "missing CSV in an override": (["run", "--set", "people.trajectories=no.csv"], ["people.trajectories", "no.csv"]),
    "unknown key": (["run", "--set", "trees.densty=3"], ["trees.densty", "did you mean density?"]),
    "no equals sign": (["run", "--set", "trees.density"], ["--set", "'trees.density'", "key=value"]),
    "negative density": (["run", "--set", "trees.density=-3"], ["trees.density", "-3", ">= 0"]),
    "beyond any packing": (["run", "--set", "trees.density=9000"], ["trees.density", "9000", "no more than 203"]),
    "beyond this packing": (["run", "--set", "trees.density=160"], ["trees.density", "160", "fit into 150 x 100 m"]),
    "rates that do not divide": (["run", "--set", "rates.sensing=7"], ["rates", "240 Hz", "7 Hz"]),
    "paths beyond the area": (
        ["run", "--set", "area.width=60", "--set", "uavs=[{start=[0,0]}]"],
        ["people.paths[0]", "(-30, -18)", "|x| <= 29"],
    ),
    "UAVs beyond the area": (["run", "--set", "area.width=40"], ["uavs.0.start", "outside the area"]),
    "area too small for people": (
        ["run", "--set", "area.height=9", "--set", "uavs=[{start=[0,0]}]", "--set", "trees.density=0"],
        ["area", "150 x 9 m", "10 m"],
    ),
    "unknown unit": (["run", "--duration", "40 furlongs"], ["--duration", "'furlongs'", "s, ms, min, h"]),
    "near unit": (["run", "--duration", "1mins"], ["--duration", "'1mins'", "did you mean min?"]),
    "no duration": (["run", "--duration", "long"], ["--duration", "'long'", "1.5min"]),
    "negative duration": (["run", "--duration", "-5"], ["--duration", "'-5'", "more than 0 s"]),
    "endless duration": (["run", "--duration", "inf"], ["--duration", "'inf'"]),
    "broken seed": (["run", "--seed", "1.5"], ["--seed", "'1.5'", "an integer, 0 to 3402823669"]),
    "negative seed": (["run", "--seed", "-1"], ["--seed", "'-1'", "an integer, 0 to 3402823669"]),
    "unknown planner": (["run", "--planner", "hoover"], ["planner", "'hoover'", "did you mean hover?"]),
    "unknown module": (["run", "--planner", "nowhere:It"], ["planner", "'nowhere:It'", "No module named 'nowhere'"]),
    "unknown class": (["run", "--planner", "sim:It"], ["planner", "'sim:It'", "no class 'It'"]),
    "folder with a run": (["run", "--out", "full"], ["--out", "full", "already holds a run"]),
    "folder with something": (["run", "--out", "other"], ["--out", "other", "not an empty folder"]),
    "file for a folder": (["run", "--out", "bad.csv"], ["--out", "bad.csv", "not an empty folder"]),
    "folder in a file": (["run", "--out", "bad.csv/run"], ["--out", "bad.csv/run", "cannot be written"]),
    "folder that cannot be": (["run", "--out", "/proc/a/run"], ["--out", "/proc/a/run", "cannot be written"]),
    "name too long": (["run", "--out", f"new/{'a' * 300}"], ["--out", "cannot be written", "too long"]),
    "folder without a name": (["run", "--out", ""], ["--out", "no name"]),
    "seeds out of order": (["compare", "--seeds", "9-0"], ["--seeds", "'9-0'", "0-9 or 0,3,7"]),
    "one wrong planner": (["compare", "--planner", "hover", "--planner", "gredy"], ["'gredy'", "did you mean greedy?"]),
    "unknown format": (["export", "full", "--to", "cvs"], ["--to", "'cvs'", "did you mean csv?"]),
    "export of no run": (["export", "full", "--to", "csv"], ["DIR", "full", "holds no mission.npz"]),
    "no worker": (["compare", "--workers", "0"], ["--workers", "'0'", "an integer, 1 to 1024"]),
}


@pytest.mark.parametrize(("arguments", "words"), WRONG.values(), ids=WRONG)
def test_wrong_input_is_one_line_exit_code_2_and_leaves_nothing(call, tmp_path, arguments, words):
    for name, content in BROKEN.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    before = sorted(tmp_path.rglob("*"))
    code, out, err = call(*arguments)
    assert code == 2
    assert err.startswith("understory: ") and err.count("\n") == 1
    assert "Traceback" not in out
    for word in words:
        assert word in err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("command", [["run", "--planner"], ["compare", "--planner"], ["check-planner"]])
def test_an_error_in_a_planners_constructor_is_one_line_that_says_where(call, tmp_path, monkeypatch, command):
    monkeypatch.delitem(sys.modules, "faulty", raising=False)
    (tmp_path / "faulty.py").write_text(PLANNER)
    code, out, err = call(*command, "faulty:Wrong")
    assert (code, out, err.count("\n")) == (2, "", 1)
    place = f"({tmp_path / 'faulty.py'}:4, in __init__)"
    assert f"'faulty:Wrong' cannot be made: a fault of the program, not of its user {place}" in err
    assert [path.name for path in tmp_path.iterdir() if path.name != "__pycache__"] == ["faulty.py"]


def test_the_bare_command_shows_how_to_start_within_80_columns(call):
    code, out, err = call()
    assert (code, err) == (0, "")
    assert "understory run" in out and "understory compare" in out and "--help" in out
    assert max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize("command", [None, *COMMANDS], ids=lambda command: command and command.__name__)
def test_every_command_has_help_without_types_of_python(call, command):
    code, out, err = call(*([] if command is None else [command.__name__.replace("_", "-")]), "--help")
    assert (code, err) == (0, "")
    assert "Usage: " in out and "--help" in out
    assert not re.search("<|BOOLEAN|TEXT|PATH", out)


@pytest.mark.parametrize("module", ["sim.calibration", "sim.report.wide_table", "sim.report.message_losses"])
def test_modules_that_are_commands_have_help_and_complain_in_a_line(module, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    words = [[sys.executable, "-m", module, option] for option in ("--help", "--nonsense")]
    asked, wrong = (subprocess.run(w, cwd=tmp_path, env=environment, capture_output=True, text=True) for w in words)
    assert (asked.returncode, asked.stderr) == (0, "") and "Usage: " in asked.stdout and "<" not in asked.stdout
    assert wrong.returncode == 2 and wrong.stderr.startswith("understory: ") and wrong.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_version_is_that_of_the_package(call):
    assert call("--version") == (0, f"understory {version('understory')}\n", "")


def test_planners_and_scenarios_are_listed_with_their_meaning(call):
    _, out, _ = call("planners")
    for name, spec in PLANNERS.items():
        assert name in out and spec.summary in out
    assert out.count("(default)") == 1
    _, out, _ = call("scenarios")
    assert all(name in out for name in SCENARIOS)


AILING = """
class Ailing:
    def plan(self, team, rng):
        raise RuntimeError("[bold]lost")
"""


def test_a_run_shows_time_ospa_results_faults_and_files(call, tmp_path):
    (tmp_path / "ailing.py").write_text(AILING)
    options = ["--planner", "ailing:Ailing", "--duration", "4s", "--set", "sensing.mode=ideal", "--no-video"]
    code, out, err = call("run", *options)
    assert (code, err) == (0, "")
    assert "4.0 of 4 s, OSPA " in out and "ailing:Ailing, seed 0, 4.0 s" in out
    before, _, after = out.partition("┏")
    assert "fault at 0.0 s, 5 times until 4.0 s, team: RuntimeError: [bold]lost\n" in before and "fault" not in after
    assert f"{tmp_path / 'ailing.py'}:4, in plan: raise RuntimeError" in before and "All 5 faults" in before
    assert "Files in runs/forest-ailing.Ailing-seed0:\n  mission.npz, ospa.png, summary.json, timeline.png\n" in out
    assert "Files in runs/forest-ailing.Ailing-seed0-2:" in call("run", *options)[1]


def test_a_comparison_shows_one_row_per_planner(call):
    options = ["--planner", "hover", "--planner", "greedy", "--seeds", "0,1", "--duration", "1"]
    code, out, err = call("compare", *options, "--set", "sensing.mode=ideal")
    assert (code, err) == (0, "")
    assert "4/4 trials" in out
    lines = [line.split() for line in out.splitlines()]
    assert [line[:2] for line in lines if line[:1] in (["hover"], ["greedy"])] == [["hover", "2"], ["greedy", "2"]] * 3
    assert max(map(len, out.splitlines())) <= 80


def test_commands_that_fly_nothing_import_no_engine_and_no_compiler():
    call = "sim.__main__.app(['planners'], standalone_mode=False)"
    heavy = "{'numpy', 'numba', 'pybullet', 'scipy', 'cv2', 'av', 'matplotlib'} & set(sys.modules)"
    code = f"import sys, sim.__main__; {call}; print({heavy})"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"


def test_importing_the_engine_says_nothing():
    command = [sys.executable, "-c", "import sim.world.world"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


def test_an_error_is_the_only_output_of_a_real_process(tmp_path):
    command = [sys.executable, "-m", "sim", "run", "--set", "trees.density=9000"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("understory: trees.density = 9000") and done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_one_line_and_other_errors_of_files_are_not_hidden(call, monkeypatch):
    def full(number):
        def save(recording, path):
            raise OSError(number, os.strerror(number), "mission.npz")

        return save

    monkeypatch.setattr("sim.running.run.save", full(errno.ENOSPC))
    words = ["run", "--duration", "1", "--no-video", "--planner", "hover", "--set", "sensing.mode=ideal", "--out", "r"]
    code, _, err = call(*words)
    assert (code, err) == (1, "understory: mission.npz: No space left on device; nothing is kept\n")
    assert not list(Path().iterdir())
    monkeypatch.setattr("sim.running.run.save", full(errno.ENOENT))
    with pytest.raises(FileNotFoundError):
        call(*words)


def test_a_long_refusal_keeps_its_ends_and_prints_only_what_is_printable(call):
    code, _, err = call("run", "--seed", "\x1b[2J" + "9" * 100_000)
    assert code == 2 and err.startswith("understory: --seed: ") and len(err) < 2100
    assert "\x1b" not in err and err.endswith("expected an integer, 0 to 340282366920938463463374607431768211455\n")
