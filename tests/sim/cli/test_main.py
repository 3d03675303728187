"""The command line: what it answers, and how it refuses wrong input."""

import errno
import re
from importlib.metadata import version
from io import BytesIO, TextIOWrapper

import pytest
from helpers.flown_pages import eventful
from helpers.processes import python
from helpers.recordings import record

from planning.catalogue import PLANNERS
from sim.__main__ import COMMANDS
from sim.cli.run_flight import show_run
from sim.mission.archive import save
from sim.scenario.loading import SCENARIOS
from sim.study.definition import STUDIES
from sim.terminal.commands import load_command, run_command_line
from sim.terminal.console import say

AILING = """
class Ailing:
    def plan(self, team, rng):
        raise RuntimeError("[bold]lost")
"""


def test_the_bare_command_shows_how_to_start_within_80_columns(call):
    code, out, err = call()
    assert (code, err) == (0, "")
    assert "understory run" in out and "understory compare" in out and "--help" in out
    assert max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize("command", [None, *COMMANDS])
def test_every_command_has_help_without_types_of_python(call, command):
    code, out, err = call(*([] if command is None else [command]), "--help")
    assert (code, err) == (0, "") and "Usage: " in out and "--help" in out
    assert not re.search("<|BOOLEAN|TEXT|PATH", out)
    flat = " ".join(out.replace("│", " ").split())
    for param in load_command(COMMANDS[command][0]).params if command else ():
        assert " ".join(param.help.split()) in flat and "  " not in param.help


def test_without_any_folder_for_temporary_files_commands_say_so(call, monkeypatch):
    def no_folder():
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp', '/']")

    monkeypatch.setattr("tempfile.gettempdir", no_folder)
    told = "understory: TMPDIR: no temporary folder can be written to; name one that can\n"
    assert call("run", "--planner", "hover") == (2, "", told)


def test_version_planners_scenarios_and_studies_are_told_with_their_meaning(call):
    assert call("--version") == (0, f"understory {version('understory')}\n", "")
    _, out, _ = call("planners")
    for name, spec in PLANNERS.items():
        assert name in out and spec.summary in out
    assert out.count("(default)") == 1
    _, out, _ = call("scenarios")
    assert all(name in out for name in SCENARIOS) and all(name in call("studies")[1] for name in STUDIES)


def test_a_run_shows_time_ospa_results_faults_and_files(call, tmp_path, monkeypatch):
    (tmp_path / "ailing.py").write_text(AILING)
    (tmp_path / "runs" / "forest-ailing.Ailing-seed0").mkdir(parents=True)
    options = ["--planner", "ailing:Ailing", "--duration", "4s", "--set", "sensing.mode=ideal", "--no-video"]
    code, out, err = call("run", *options)
    assert (code, err) == (0, "") and "ailing:Ailing, seed 0, 4.0 s" in out
    before, _, after = out.partition("┏")
    assert "fault at 0.0 s, 5 times until 4.0 s, team: RuntimeError: [bold]lost\n" in before and "fault" not in after
    assert f"{tmp_path / 'ailing.py'}:4, in plan: raise RuntimeError" in before and "All 5 faults" in before
    assert re.search("decisions that failed +│ +100.0 %", after)
    assert "Files in runs/forest-ailing.Ailing-seed0-2:\n  mission.npz, ospa.png, summary.json, timeline.png\n" in out


def test_a_fault_of_several_uavs_is_shown_once_and_further_kinds_are_counted(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("sim.cli.run_flight.make_results_table", lambda summary: "")
    blind = [
        {"time": 0.1 * k, "uav": uav, "message": "ValueError: no", "trace": ["mine.py:4, in detect: raise"]}
        for k in range(2)
        for uav in range(3)
    ]
    elsewhere = {"time": 0.3, "uav": 1, "message": "ValueError: no", "trace": ["mine.py:9, in detect: raise"]}
    team = {"time": 0.4, "uav": None, "message": "AttributeError: team[0].trackz", "trace": []}
    faults = [*blind, elsewhere, team]

    def shown(faults):
        show_run({"faults": faults}, tmp_path)
        return [line for line in capsys.readouterr().out.splitlines() if line.startswith(("fault", "All"))]

    lines = [
        "fault at 0.0 s, 6 times until 0.1 s, UAVs 0, 1 and 2: ValueError: no",
        "fault at 0.3 s, UAV 1: ValueError: no",
        "fault at 0.4 s, team: AttributeError: team[0].trackz",
    ]
    assert shown(faults) == [*lines, "All 8 faults are in summary.json."]
    more = [*faults, {"time": 0.5, "uav": 0, "message": "ValueError: late"}]
    assert shown(more) == [*lines, "All 9 faults, of 4 kinds, are in summary.json."]


def test_missions_without_people_or_losses_are_explained(call, tmp_path):
    save(record(people=0), tmp_path / "mission.npz")
    code, out, err = call("explain", ".")
    assert (code, err) == (0, "") and out.startswith("No person walked in this mission.\n")
    assert (tmp_path / "timeline.png").read_bytes().startswith(b"\x89PNG")
    save(record(people=1), tmp_path / "mission.npz")
    out = call("explain", ".")[1]
    assert out.startswith("No person was lost.\n") and "All of person 0: understory explain . --target 0\n" in out
    assert "The worst loss" not in out


def test_a_mission_is_explained_by_its_losses_and_a_person_scan_by_scan(call, tmp_path):
    save(eventful(), tmp_path / "mission.npz")
    code, out, err = call("explain", ".")
    assert (code, err) == (0, "") and out.splitlines()[0] == "losses"
    told = [line.split(": ")[:2] for line in out.splitlines()[1:4]]
    times = ("  from 3.0 s to the end", "  1.0 to 2.0 s", "  1.6 to 1.8 s")
    texts = [f"person {m} lost, outside the ellipse of the track" for m in (0, 2, 1)]
    assert told == [[when, text] for when, text in zip(times, texts, strict=True)]
    assert "All of person 0: understory explain . --target 0\n" in out
    assert "  lost  " not in out and "  lost  " in call("explain", ".", "--target", "0")[1]


@pytest.mark.parametrize("encoding", ["ascii", "cp437", "cp1251", "latin-1", "utf-8"])
def test_a_character_that_the_terminal_does_not_have_is_replaced(call, tmp_path, monkeypatch, encoding):
    save(eventful(), tmp_path / "mission.npz")
    with monkeypatch.context() as terminal:
        out = TextIOWrapper(BytesIO(), encoding=encoding)
        terminal.setattr("sys.stdout", out)
        assert call("explain", ".", "--target", "0", "--time", "0.4")[0] == 0
        run_command_line(lambda **given: say("NEES of 3 σ² – 林"))
        out.flush()
        told = out.buffer.getvalue().decode(encoding).splitlines()
    assert told[0] == "person 0 at 0.4 s" and told[-1].startswith("NEES of 3 ")
    assert ("林" in told[-1]) == (encoding == "utf-8")


def test_help_imports_nothing_heavy(tmp_path):
    heavy = "{'numpy', 'numba', 'pybullet', 'scipy', 'cv2', 'av', 'matplotlib'} & set(sys.modules)"
    light = f"import sys, sim.__main__; sim.__main__.app(['--help'], standalone_mode=False); print({heavy})"
    done = python("-c", light, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.splitlines()[-1] == "set()"
    assert list(tmp_path.iterdir()) == []


def test_a_long_refusal_keeps_its_ends(call):
    code, _, err = call("run", "--seed", "\x1b[2J" + "9" * 100_000)
    assert code == 2 and err.startswith("understory: --seed: ") and len(err) < 2100
    assert "\x1b" not in err and err.endswith("expected an integer, 0 to 340282366920938463463374607431768211455\n")


def test_errors_of_files_other_than_a_full_disk_are_not_hidden(call):
    def lose(**given):
        raise FileNotFoundError(errno.ENOENT, "No such file", "mission.npz")

    with pytest.raises(FileNotFoundError):
        run_command_line(lose)


def test_ctrl_c_while_something_is_half_made_is_said_in_one_line():
    code = """
import signal
from sim.terminal.commands import run_command_line

class Half:
    def __init__(self):
        signal.raise_signal(signal.SIGINT)
        self.whole = True

    def __del__(self):
        del self.whole

run_command_line(lambda **given: Half())
"""
    ended = python("-c", code)
    assert (ended.returncode, ended.stderr) == (1, "understory: interrupted; nothing new is kept\n")
