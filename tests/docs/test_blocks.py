"""Blocks of README and pages run, and say what stands below them; `pytest -m docs` runs those that take long."""

import csv
import re
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers.browser import CHROMIUM, Browser
from helpers.pages import DOCS, PAGES, ROOT, SHORTER, Shell, blocks, generator, text_of
from helpers.studies import short, sql, store

import understory
from sim.study.cells import list_cells
from sim.study.definition import read_study
from sim.study.trial_flight import fly_trial
from sim.study.trials import list_trials

APART = ("lost-person", "learning", "trained-detector", "pilot")
TUTORIALS = [page for page in PAGES if page.parent.name == "tutorials" and page.stem not in APART]
# The blocks of the other pages are run by the tests below and beside this file, and in the folders of the code.
NAMES = (
    "index",
    *(f"how-to/{name}" for name in ("mapping", "planners", "trackers", "wrapping")),
    *(f"explanation/{name}" for name in ("equations", "frames-to-tracks", "rivals")),
    *(f"reference/{name}" for name in ("api", "metrics", "planners")),
)
README = {"run": ["--duration", "2", "--no-video"], "compare": ["--duration", "1", "--seeds", "0,1"]}
README |= {command: ["--time", "1"] for command in ("frames", "explain")} | {"replay": ["--time", "1:2"]}


@pytest.fixture
def shell(tmp_path, monkeypatch, capsys):
    """The command line and Python of pages, in an empty folder."""
    yield Shell(tmp_path, monkeypatch, capsys)
    for name, module in list(sys.modules.items()):  # another page may have modules of the same names
        if (getattr(module, "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.mark.docs
def test_every_block_of_the_readme_runs(shell, tmp_path):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert text.count("In `myplanner.py`:\n\n```python\n") == 1
    shell.execute(text.replace("py`:\n\n```python\n", "py`:\n\n```python\n# myplanner.py\n"), "README.md", README)
    assert (tmp_path / "scan7.png").stat().st_size > 10_000
    assert len(list((tmp_path / "runs").glob("*/mission.npz"))) == 4
    assert len(list((tmp_path / "runs").glob("*/frames-uav1-1s/*.png"))) == 1


@pytest.mark.docs
@pytest.mark.parametrize("name", [*(f"tutorials/{page.stem}" for page in TUTORIALS), *NAMES])
def test_a_pages_blocks_run(name, shell):
    names = shell.execute(text_of(name), name)
    if test := names.get("test_it_conforms"):
        test()


@pytest.mark.docs
def test_the_commands_on_replay_run(shell, tmp_path):
    shell.execute(text_of("how-to/replay"), "replay.md", {"run": ["--duration", "3"]})
    run = tmp_path / "runs" / "short"
    assert (run / "replay.mp4").stat().st_size == (run / "mission.mp4").stat().st_size
    assert (tmp_path / "uav1.mp4").is_file()


@pytest.mark.docs
def test_the_commands_on_flights_run(shell, tmp_path):
    shell.line("understory run --duration 2 --no-video")
    shell.execute(text_of("how-to/flights"), "flights.md", {"track": ["--no-video"]})
    folders = [tmp_path / name / "mission.npz" for name in ("tracked", "tracked-on-a-slope")]
    assert folders[0].read_bytes() != folders[1].read_bytes()


@pytest.mark.docs
def test_the_trained_detector_stands_the_noise_that_the_default_one_does_not(shell, tmp_path):
    few = {"compare": ["--duration", "4", "--seeds", "100,101"]}
    shell.execute(text_of("tutorials/trained-detector"), "trained-detector.md", few)
    with (tmp_path / "runs" / "detectors" / "table.csv").open(newline="") as file:
        means = {(row["detector"], row["metric"]): float(row["mean"]) for row in csv.DictReader(file)}
    assert means["learned", "detection.precision"] > 0.95 > 0.5 > means["blob", "detection.precision"]
    assert means["learned", "detection.recall"] > 0.8 and means["blob", "ospa.mean_m"] > 10


@pytest.mark.docs
def test_the_commands_on_ten_worlds_fly_their_planners(shell, monkeypatch):
    """Each in one of the worlds, for a second; figures of reports are laid out, and no files are made of them."""
    monkeypatch.setattr("sim.study.report.figures.pictures.encode_figure", lambda figure, kind: b"")
    bench = {name.split("(")[0] for name in read_study("bench-1").planners}
    text = re.sub(r"--seeds (\d+)[\d-]*", r"--seeds \1", text_of("results/worlds").replace("\\\n", " "))
    lines = [line for _, block in blocks(text) for line in block.splitlines()]
    assert len(lines) == 2
    for k, command in enumerate(lines):
        out = shell.line(command, "--scenario", "paper", "--duration", "1.2", "--out", f"runs/{k}")
        planners = set(re.findall(r"--planner '?([\w-]+)", command)) or bench
        assert planners == {name for name in planners if name in out} and len(planners) >= 2


@pytest.mark.slow
def test_notebooks_run_in_a_kernel(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    for page in TUTORIALS:
        made = nbformat.from_dict(generator().notebook(page.read_text(encoding="utf-8")))
        nbclient.NotebookClient(made, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()


@pytest.mark.docs
def test_the_tutorial_on_learning_trains_and_flies(shell, monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "examples" / "seedling"))
    tiny = ["--missions", "2", "--duration", "2", "--epochs", "2", "--validations", "1", "--expert", "greedy"]
    text = text_of("tutorials/learning").replace("'seedling(", "'seedling.planner:Seedling(")
    shell.execute(text, "learning.md", {**SHORTER, "-m": tiny})
    assert {path.name for path in shell.folder.iterdir()} >= {"tiny.npz", "tiny.csv", "mine.npz", "runs"}


def test_a_notebook_holds_the_blocks_of_its_page_in_order():
    page = text_of("tutorials/your-world")
    cells = [cell for cell in generator().notebook(page)["cells"] if cell["cell_type"] == "code"]
    shown = [content for language, content in blocks(page) if language in ("sh", "python", "toml")]
    for cell, content in zip(cells, shown, strict=True):
        source = "".join(cell["source"]).removeprefix("%%writefile clearing.toml\n")
        assert re.sub(r"^!", "", source, flags=re.M) == content.rstrip("\n")


@pytest.mark.docs
def test_the_commands_on_a_lost_person_say_what_the_tutorial_shows(shell, tmp_path):
    shutil.copytree(DOCS / "examples" / "grove", tmp_path / "docs" / "examples" / "grove")
    quoted = 0
    for language, content in blocks(text_of("tutorials/lost-person")):
        if language == "text":
            for line in content.splitlines():
                assert line in shell.told, line
                quoted += 1
            continue
        for command in content.splitlines():
            shell.line(command, *(["--duration", "1"] if " run " in command else []))
    assert quoted > 15
    made = {path.name for path in (tmp_path / "runs").iterdir()}
    pictures = {"timeline.png", "person1.png", "lost.png", "before.png", "frames", "plan.png", "regained.mp4"}
    assert made == {"grove", "grove-oracle", *pictures}
    assert len(list((tmp_path / "runs" / "frames").iterdir())) == 10


@pytest.mark.docs
def test_a_pilots_files_become_a_film_one_sheet_and_an_answer_and_mistakes_say_what_to_change(shell, tmp_path):
    page = text_of("tutorials/pilot")
    shell.execute(page, "pilot.md", {**SHORTER, "run": ["--duration", "2"]})
    quoted = [line for language, content in blocks(page) if language == "text" for line in content.splitlines()]
    assert len(quoted) == 3 and {*quoted} <= {line.replace(f"{tmp_path}/", "") for line in shell.told}
    assert any(re.search(r"cheapest of 6 with|none of 6 combinations", line) for line in shell.told)
    assert (tmp_path / "runs" / "search" / "mission.mp4").stat().st_size > 10_000
    if CHROMIUM:
        with Browser(tmp_path / "profile") as browser:
            browser.open(tmp_path / "runs" / "search" / "mission.html")
            assert browser.print() == 1
    toml, stems, people = ((tmp_path / name).read_text() for name in ("search.toml", "stems.csv", "people.gpx"))
    wrong = {
        "are latitude and longitude swapped": (re.sub(r"(49\.\d+),(8\.\d+)", r"\2,\1", stems), "stems.csv"),
        "files of a mission or flight have one origin": (people.replace("49.0", "49.1"), "people.gpx"),
        "are the time zones right?": (toml.replace("+02:00", ""), "search.toml"),
        "times as high as thick": (
            re.sub(r"\d+\.\d+$", lambda h: f"{float(h[0]) / 0.3048}", stems, flags=re.M),
            "stems.csv",
        ),
        "is outside the area": (toml.replace("100", "60"), "search.toml"),
        "the tallest crown reaches": (toml.replace("40", "15"), "search.toml"),
        "stands where person": (f"{stems}99,oak,49.041002,8.456779,30,15\n", "stems.csv"),
    }
    listed = page.partition("| the line says |")[2]
    for said, (text, name) in wrong.items():
        for file, content in (("search.toml", toml), ("stems.csv", stems), ("people.gpx", people), (name, text)):
            (tmp_path / file).write_text(content)
        _, _, err = shell.call("run", "search.toml", "--duration", "1", "--set", "sensing.mode=ideal", "--no-video")
        assert said in err and f"{said}`" in listed, err
    assert listed.count("\n|") == 1 + len(wrong)


def test_the_recording_of_the_lost_person_is_of_its_scenario():
    recording = understory.load(DOCS / "examples" / "grove").recording
    flown = understory.mission(DOCS / "examples" / "grove" / "grove.toml", seed=7)
    assert recording.setting == flown.scenario
    assert recording.seed == 7 and len(recording.trees) == 12 and len(recording.times) == 151


@pytest.mark.docs
def test_the_commands_on_debugging_tell_of_the_lost_person(shell, tmp_path):
    page = text_of("how-to/debugging")
    (_, block), (_, losses), *_, (_, frames) = blocks(page)
    outputs = [shell.line(line) for line in block.splitlines()]
    folder = tmp_path / "runs" / "dense"
    assert outputs[0].count("timeline.png") == 1 and outputs[1] == losses
    assert outputs[2].count("person ") == 1 and "off the track  hidden by tree" in outputs[2]
    assert outputs[3].startswith("person 2 at 3.2 s\n  is at (") and "  off the track since " in outputs[3]
    assert re.search(r"hidden by tree (\d+), .*\n  tree \1 stands at ", outputs[3])
    picture = "explain-target2-3.2s.png"
    assert {path.name for path in folder.iterdir()} >= {"timeline.png", picture}
    assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    shell.line(frames.strip())
    assert "`frames-uav1-3-3.4s`" in page and len([*(folder / "frames-uav1-3-3.4s").iterdir()]) == 3


@pytest.mark.docs
def test_the_commands_on_rerun_run(shell, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    page = text_of("how-to/rerun")
    ((_, commands),) = blocks(page)
    for line in commands.splitlines():
        shell.line(line, *(["--duration", "1", "--no-video"] if " run " in line else []))
    paths = {str(part.entity_path) for part in chunk.RrdReader(tmp_path / "found.rrd").stream().to_chunks()}
    named = re.findall(r"`((?:world/|ospa|bytes|events)[\w/]*)`", page)
    assert len(named) > 8
    named.remove("world/maps/0")  # of UAVs that map, which tests/sim/mission/test_mapped_forests.py flies
    for name in named:
        assert any(path == f"/{name}" or path.startswith(f"/{name}/") for path in paths), name
    code, _, err = shell.call(*line.split()[1:])
    assert code == 2 and "found.rrd" in err


def test_what_a_planner_can_know_is_what_the_scenario_says():
    *helpers, _ = (content for language, content in blocks(text_of("how-to/planners")) if language == "python")
    names, seen = {}, []
    exec(compile("".join(helpers), "planners.md", "exec"), names)

    class Asking:
        def plan(self, team, rng):
            seen.append(team)
            return [understory.Plan(np.ones((3, 2)) * situation.time) for situation in team]

    scenario = understory.run(planner=Asking(), settings={"duration": 2, "sensing.mode": "ideal"}).scenario
    near = [(x, y, 0.0) for x in (-20.0, 0.0, 20.0) for y in (-20.0, 0.0, 20.0)]  # m
    for situation, uav in zip(seen[2], scenario.uavs, strict=True):
        own, people = situation.own, np.array([track.belief.mean[:2] for track in situation.tracks])
        assert names["tracker_step"](situation) == pytest.approx(1 / scenario.rates.sensing)
        assert names["footprint"](own) == pytest.approx(uav.footprint, rel=1e-3)
        assert names["alpha"](own) == pytest.approx(uav.alpha)
        shown = [names["seen"](situation, own, np.add(own.position, gap), people) for gap in near]
        assert np.any(shown) and not np.all(shown)
        assert names["measurement_covariance"](own, people[0]).shape == (2, 2)
        # Made at 1 s, and not yet shortened by the control that was flown since.
        told = {j: plan.controls.tolist() for j, plan in situation.intents.items()}
        assert told == dict.fromkeys(range(3), [[1, 1]] * 3)
    assert not seen[0][0].intents


def test_study_files_query_python_and_metrics_on_pages_are_as_they_say(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = text_of("how-to/studies")
    found = {language: content for language, content in blocks(page) if language != "sh"}
    (tmp_path / "mine.toml").write_text(found["toml"])
    assert len(list_trials(read_study("mine.toml"))) == 10 * 2 * (1 + 2)
    (tmp_path / "trackers.toml").write_text(dict(blocks(text_of("how-to/trackers")))["toml"])
    assert [cell.settings for cell in list_cells(read_study("trackers.toml"))] == [
        {"tracking.tracker": "jpda"}, {"tracking.management": "m_of_n"}, {"tracking.tracker": "mytracker:Nearest"}
    ]  # fmt: skip
    made = short(["hover"], "0-1", factors={"lambda": {"15": {"trees": {"density": 15}}}})
    mean = np.mean([row.metrics["ospa.share_under_1m"] for row in store(tmp_path, made)])
    assert sql(tmp_path, found["sql"]) == [("15", "hover", pytest.approx(mean))]
    monkeypatch.setattr(understory, "Pool", lambda: ThreadPoolExecutor(1))
    exec(compile(found["python"], "studies.md", "exec"), {"__name__": "__main__"})
    assert "breakdown" in capsys.readouterr().out
    listed = page + text_of("reference/metrics")
    for name in fly_trial(made[0]).row.metrics:
        assert f"`{name}`" in listed or name.startswith("seconds.")
