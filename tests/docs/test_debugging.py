"""docs/how-to/debugging.md and the command explain: what is shown runs, and wrong input is refused in one line."""

import re
import shlex
import sys
from pathlib import Path

import pytest
from helpers.commands import called

from sim import __main__ as cli
from sim.terminal import console

TEXT = (Path(__file__).parents[2] / "docs" / "how-to" / "debugging.md").read_text(encoding="utf-8")


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """Calls the command line in an empty folder of its own: exit code, standard output and standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(console.console, "width", 100)
    return lambda *arguments: called(arguments, monkeypatch, capsys)


def test_its_commands_run_and_tell_of_the_lost_person(call, tmp_path):
    (block,) = re.findall(r"^```sh\n(.*?)^```$", TEXT, flags=re.M | re.S)
    outputs = []
    for line in block.splitlines():
        code, out, err = call(*shlex.split(line)[1:])
        assert (code, err) == (0, "")
        outputs.append(out)
    folder = tmp_path / "runs" / "dense"
    assert outputs[0].count("timeline.png") == 1 and "\nTimeline: runs/dense/timeline.png\n" in outputs[1]
    assert outputs[1].splitlines()[-1].startswith("The longest loss: understory explain runs/dense --target 1 --time ")
    assert [f"person {m}" in outputs[1].splitlines() for m in range(4)] == [True] * 4
    assert outputs[2].count("person ") == 1 and "lost  hidden by tree" in outputs[2]
    assert outputs[3].startswith("person 1 at 3.6 s\n  is at (") and "  lost since " in outputs[3]
    assert re.search(r"hidden by tree (\d+), .*\n  tree \1 stands at ", outputs[3])
    files = {path.name for path in folder.iterdir()}
    picture = "explain-target1-3.6s.png"
    assert files == {"mission.npz", "ospa.png", "summary.json", "timeline.png", picture}
    assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    (folder / "timeline.png").rename(folder / "first.png")
    call("explain", "runs/dense/mission.npz", "--out", "again.png")
    assert (tmp_path / "again.png").read_bytes() == (folder / "first.png").read_bytes()


WRONG = {
    "beyond the mission": (["--time", "1.3", "--target", "0"], "--time: 1.3 s is not in the recording; allowed"),
    "no such person": (["--time", "1", "--target", "4"], "--target: '4' is not allowed; expected an integer, 0 to 3"),
    "no such name": (["--target", "one"], "--target: 'one' is not allowed; expected an integer, 0 to 3"),
    "no target": (["--time", "1"], "--target: missing"),
    "when": (["--time", "soon", "--target", "0"], "--time: 'soon' is not a time"),
    "several times": (["--time", "0:1", "--target", "0"], "--time: '0:1' is not allowed; expected one time"),
    "old file": (["--out", "one/ospa.png"], "--out: one/ospa.png exists; name a new file"),
    "no picture": (["--out", "timeline.pdf"], "--out: 'timeline.pdf' is not allowed; expected a new file that ends"),
    "no folder": (["--out", "no/where.png"], "--out: no/where.png cannot be written: there is no folder no"),
}  # fmt: skip


def test_what_cannot_be_explained_is_refused_in_one_line_and_leaves_nothing(call, tmp_path):
    ideal = ["--set", "sensing.mode=ideal", "--no-video", "--planner", "hover"]
    assert call("run", "--duration", "1", *ideal, "--out", "one")[0] == 0
    assert call("run", "--duration", "1", *ideal, "--set", "people.count=0", "--out", "none")[0] == 0
    before = sorted(tmp_path.rglob("*"))
    for arguments, words in WRONG.values():
        code, _, err = call("explain", "one", *arguments)
        assert code == 2 and err.startswith(f"understory: {words}") and err.count("\n") == 1
    code, _, err = call("explain", "none", "--target", "0")
    assert (code, err) == (2, "understory: --target: '0' is not allowed; no person walked in this mission\n")
    code, _, err = call("explain", "nowhere")
    assert (code, err) == (2, "understory: DIR: nowhere does not exist\n")
    assert call("explain", "none")[1].startswith("No person walked in this mission.\n")
    assert sorted(tmp_path.rglob("*")) == before


def test_the_command_has_help(call):
    code, out, err = call("explain", "--help")
    assert (code, err) == (0, "")
    assert "Usage: " in out and "--target" in out


def test_its_words_are_those_of_the_program():
    source = "".join(
        path.read_text(encoding="utf-8") for path in (Path(cli.__file__).parent / "replay" / "explain").glob("*.py")
    )
    for words in ("lost since", "from below the camera", "detected at pixel", "in the gate of", "NEES", "existence"):
        assert words in TEXT and words in source
