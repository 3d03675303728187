"""Blocks of README and pages run, and say what stands below them; `pytest -m docs` runs those that take long."""

import csv
import importlib
import importlib.util
import re
import shlex
import shutil

import pytest
from helpers.pages import DOCS, PAGES, ROOT, SHORTER, blocks, generator

from sim.mission.archive import load
from sim.study.definition import read_study

APART = ("lost-person", "learning", "trained-detector")
TUTORIALS = [page for page in PAGES if page.parent.name == "tutorials" and page.stem not in APART]
REFERENCE = ("api", "metrics", "planners")
# The blocks of the other pages are run by the tests below and beside this file, and in the folders of the code.
NAMES = (
    "index",
    "how-to/wrapping",
    "how-to/trackers",
    "explanation/equations",
    "explanation/frames-to-tracks",
    "explanation/rivals",
    *(f"reference/{n}" for n in REFERENCE),
)
BENCH = read_study("bench-1")
README = {"run": ["--duration", "2", "--no-video"], "compare": ["--duration", "1", "--seeds", "0,1"]}
README |= {command: ["--time", "1"] for command in ("frames", "explain")} | {"replay": ["--time", "1:2"]}


def text_of(name):
    return (DOCS / name).read_text(encoding="utf-8")


@pytest.mark.docs
def test_every_block_of_the_readme_runs(shell, tmp_path):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert text.count("In `myplanner.py`:\n\n```python\n") == 1
    shell.execute(text.replace("py`:\n\n```python\n", "py`:\n\n```python\n# myplanner.py\n"), "README.md", README)
    assert (tmp_path / "scan7.png").stat().st_size > 10_000
    assert len(list((tmp_path / "runs").glob("*/mission.npz"))) == 4
    assert len(list((tmp_path / "runs").glob("*/frames-uav1-1s/*.png"))) == 1


@pytest.mark.docs
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_tutorials_notebook_runs(page, shell):
    shell.execute(page.read_text(encoding="utf-8"), page.name)


@pytest.mark.docs
def test_the_trained_detector_stands_the_noise_that_the_default_one_does_not(shell, tmp_path):
    few = {"compare": ["--duration", "4", "--seeds", "100,101"]}
    shell.execute(text_of("tutorials/trained-detector.md"), "trained-detector.md", few)
    with (tmp_path / "runs" / "detectors" / "table.csv").open(newline="") as file:
        means = {(row["detector"], row["metric"]): float(row["mean"]) for row in csv.DictReader(file)}
    assert means["learned", "detection.precision"] > 0.95 > 0.5 > means["blob", "detection.precision"]
    assert means["learned", "detection.recall"] > 0.8 and means["blob", "ospa.mean_m"] > 10


@pytest.mark.docs
@pytest.mark.parametrize("name", NAMES)
def test_a_pages_blocks_run(name, shell):
    shell.execute(text_of(f"{name}.md"), name)


@pytest.mark.docs
def test_the_commands_on_ten_worlds_fly_their_planners(shell, monkeypatch):
    """Each in one of the worlds, for a second; figures of reports are laid out, and no files are made of them."""
    monkeypatch.setattr("sim.study.report.figures.pictures.encode_figure", lambda figure, kind: b"")
    page = text_of("results/worlds.md").replace("\\\n", " ")
    text = re.sub(r"--seeds (\d+)[\d-]*", r"--seeds \1", page)
    found = blocks(re.sub(r"( --scenario [\w-]+)+", " --scenario paper", text))
    commands = [line for _, block in found for line in block.splitlines()]
    for k, command in enumerate(commands):
        world = () if "--scenario" in command else ("--scenario", "paper")
        out = shell.line(command, *world, "--duration", "1.2", "--out", f"runs/{k}")
        planners = set(re.findall(r"--planner '?([\w-]+)", command)) or {name.split("(")[0] for name in BENCH.planners}
        assert planners == {name for name in planners if name in out} and len(planners) >= 2
    assert len(commands) == 2


@pytest.mark.slow
def test_notebooks_run_in_a_kernel(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    for page in TUTORIALS:
        made = nbformat.from_dict(generator().notebook(page.read_text(encoding="utf-8")))
        nbclient.NotebookClient(made, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()


@pytest.mark.docs
def test_the_tutorial_on_learning_trains_and_flies(shell, monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "examples" / "seedling"))
    train = importlib.import_module("seedling.train")
    tiny = ["--missions", "2", "--duration", "2", "--epochs", "2", "--validations", "1", "--expert", "greedy"]
    text, names = text_of("tutorials/learning.md").replace("'seedling(", "'seedling.planner:Seedling("), {}
    for language, content in blocks(text):
        if language == "python":
            exec(compile(content, "learning.md", "exec"), names)
        for line in content.splitlines() if language == "sh" else ():
            words = shlex.split(line)
            if words[0] == "python":
                train.main([*words[3:], *tiny])
            elif words[0] == "understory":
                shell.line(line, *SHORTER.get(words[1], []))
    assert {path.name for path in shell.folder.iterdir()} >= {"tiny.npz", "tiny.csv", "mine.npz", "runs"}


def test_a_notebook_holds_the_blocks_of_its_page_in_order():
    page = text_of("tutorials/your-world.md")
    cells = [cell for cell in generator().notebook(page)["cells"] if cell["cell_type"] == "code"]
    shown = [content for language, content in blocks(page) if language in ("sh", "python", "toml")]
    for cell, content in zip(cells, shown, strict=True):
        source = "".join(cell["source"]).removeprefix("%%writefile clearing.toml\n")
        assert re.sub(r"^!", "", source, flags=re.M) == content.rstrip("\n")


@pytest.mark.docs
def test_the_commands_on_a_lost_person_say_what_the_tutorial_shows(shell, tmp_path):
    shutil.copytree(DOCS / "examples" / "grove", tmp_path / "docs" / "examples" / "grove")
    told, quoted = [], 0
    for language, content in blocks(text_of("tutorials/lost-person.md")):
        if language == "text":
            for line in content.splitlines():
                assert line in told, line
                quoted += 1
            continue
        for command in content.splitlines():
            out = shell.line(command, *(["--duration", "1"] if " run " in command else []))
            told += [line.rstrip() for line in out.splitlines()]
    assert quoted > 15
    made = {path.name for path in (tmp_path / "runs").iterdir()}
    pictures = {"timeline.png", "person1.png", "lost.png", "before.png", "frames", "plan.png", "regained.mp4"}
    assert made == {"grove", "grove-oracle", *pictures}
    assert len(list((tmp_path / "runs" / "frames").iterdir())) == 10


def test_the_recording_of_the_lost_person_is_of_its_scenario():
    from sim.scenario.loading import load as load_scenario

    recording = load(DOCS / "examples" / "grove" / "mission.npz")
    grove = str(DOCS / "examples" / "grove" / "grove.toml")
    assert recording.setting == load_scenario(grove)
    assert recording.seed == 7 and len(recording.trees) == 12 and len(recording.times) == 151


@pytest.mark.docs
def test_the_commands_on_debugging_tell_of_the_lost_person(shell, tmp_path):
    (_, block), (_, losses) = blocks(text_of("how-to/debugging.md"))[:2]
    outputs = [shell.line(line) for line in block.splitlines()]
    folder = tmp_path / "runs" / "dense"
    assert outputs[0].count("timeline.png") == 1 and outputs[1] == losses
    assert outputs[2].count("person ") == 1 and "off   hidden by tree" in outputs[2]
    assert outputs[3].startswith("person 2 at 3.2 s\n  is at (") and "  off the track since " in outputs[3]
    assert re.search(r"hidden by tree (\d+), .*\n  tree \1 stands at ", outputs[3])
    files = {path.name for path in folder.iterdir()}
    picture = "explain-target2-3.2s.png"
    assert files == {"mission.npz", "ospa.png", "summary.json", "timeline.png", picture}
    assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    (folder / "timeline.png").rename(folder / "first.png")
    shell.call("explain", "runs/dense/mission.npz", "--out", "again.png")
    assert (tmp_path / "again.png").read_bytes() == (folder / "first.png").read_bytes()
    (_, frames), name = blocks(text_of("how-to/debugging.md"))[-1], "frames-uav1-3-3.4s"
    shell.line(frames.strip())
    assert f"`{name}`" in text_of("how-to/debugging.md") and len([*(folder / name).iterdir()]) == 3


def test_words_of_the_page_on_debugging_are_those_of_the_program():
    folder = (ROOT / "sim" / "facts" / "explain").glob("*.py")
    source = "".join(path.read_text(encoding="utf-8") for path in folder)
    said = ("off the track", "detected at pixel", "in the gate of", "NEES", "existence")
    for words in (*said, "holds person"):
        assert words in text_of("how-to/debugging.md") and words in source


@pytest.mark.docs
def test_the_commands_on_replay_run(shell, tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    found = blocks(text_of("how-to/replay.md"))
    assert [kind for kind, _ in found] == ["sh"] * 4
    for _, text in found:
        if "--gui" in text:  # as the page says of a machine without a display
            assert shell.call(*text.split()[1:])[0] == 2
        else:
            shell.line(text, *(["--duration", "3"] if " run " in text else []))
    run = tmp_path / "runs" / "short"
    assert (run / "replay.mp4").stat().st_size == (run / "mission.mp4").stat().st_size
    assert (tmp_path / "uav1.mp4").is_file()


@pytest.mark.docs
def test_the_commands_on_rerun_run(shell, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    page = text_of("how-to/rerun.md")
    ((_, commands),) = blocks(page)
    for line in commands.splitlines():
        shell.line(line, *(["--duration", "1", "--no-video"] if " run " in line else []))
    paths = {str(part.entity_path) for part in chunk.RrdReader(tmp_path / "found.rrd").stream().to_chunks()}
    named = re.findall(r"`((?:world/|association/|people/|plots|events)[\w/]*)`", page)
    assert len(named) > 10
    for name in named:
        assert any(path == f"/{name}" or path.startswith(f"/{name}/") for path in paths), name
    assert "/plots/planning" in paths  # from summary.json
    code, _, err = shell.call(*line.split()[1:])
    assert code == 2 and "found.rrd" in err
