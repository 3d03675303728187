"""README and scenario reference say what is so: every block runs, every key and default is listed."""

import re
import shlex
import sys
from pathlib import Path

import msgspec
import pytest
from helpers.pages import generator

from planning.registry import PLANNERS
from sim.__main__ import main
from sim.scenario.fleet import Uav
from sim.scenario.loading import decode, load
from sim.scenario.network import Cut
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import tomllib

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
REFERENCE = generator().generated((ROOT / "docs" / "reference" / "scenarios.md").read_text(encoding="utf-8"))
INSTALL = ("pip install -e . && understory run", "pip install -e '.[test]' && pytest")
SHORTER = {"run": ["--duration", "2"], "compare": ["--duration", "1", "--seeds", "0,1"], "frames": ["--time", "1"]}
SHORTER |= {"check-planner": [], "explain": ["--time", "1"], "replay": ["--time", "1:2"]}


def blocks(text):
    """Language and content of every fenced block."""
    return re.findall(r"^```(\w+)\n(.*?)^```$", text, flags=re.M | re.S)


@pytest.fixture
def understory(tmp_path, monkeypatch):
    """Runs a command of the README in an empty folder, shortened."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))

    def call(line):
        program, command, *options = shlex.split(line, comments=True)
        assert program == "understory"
        whole = command == "explain" and "--time" not in options
        monkeypatch.setattr(sys, "argv", [program, command, *options, *([] if whole else SHORTER[command])])
        main()

    return call


def test_every_block_of_the_readme_runs(understory, tmp_path):
    for language, content in blocks(README):
        if language == "sh" and content.strip() in INSTALL:
            understory("understory run") if content.strip().endswith("understory run") else None
        elif language == "sh":
            for line in content.splitlines():
                understory(line)
        elif language == "python" and "class " in content:
            (tmp_path / "myplanner.py").write_text(content)
        elif language == "python":
            exec(compile(content, "README.md", "exec"), {})
        else:
            assert language in ("text", "bibtex")
    assert (tmp_path / "scan7.png").stat().st_size > 10_000
    assert len(list((tmp_path / "runs").glob("*/mission.mp4"))) == 4
    assert len(list((tmp_path / "runs").glob("*/frames-uav1-1s/*.png"))) == 1


def test_the_two_commands_are_those_of_the_checks():
    checks = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for command in INSTALL:
        assert command in checks
        assert ("sh", command + "\n") in blocks(README)


def test_the_readme_is_short_and_its_files_exist():
    assert README.count("\n") < 150
    for target in re.findall(r"\]\(([^)]+)\)", README):
        assert (ROOT / target).is_file(), target
    for name in re.findall(r"--planner ([a-z-]+)(?=\s|$)", README):
        assert name in PLANNERS


def test_every_key_of_literature_is_resolved():
    used = set()
    for package in ("sim", "planning", "tracking", "assets"):
        for path in (ROOT / package).rglob("*.py"):
            used |= set(re.findall(r"\[([A-Z][A-Za-z]+\d\d)\]", path.read_text(encoding="utf-8")))
    assert "Li22" in used
    sources = (ROOT / "docs" / "reference" / "sources.md").read_text(encoding="utf-8")
    assert used <= set(re.findall(r"^- \[(\w+)\]", sources, flags=re.M))


def defaults(kind=Scenario, prefix=""):
    """Every key of a scenario with its default as TOML; None where it is written out elsewhere."""
    for field in msgspec.structs.fields(kind):
        key = prefix + field.name
        if isinstance(field.type, type) and issubclass(field.type, msgspec.Struct):
            yield from defaults(field.type, f"{key}.")
        elif key in ("people.paths", "uavs"):
            yield key, None
        else:
            # None stands for a default that depends on other keys.
            yield key, msgspec.NODEFAULT if field.default is None else field.default


def test_the_reference_lists_every_key_with_its_default():
    listed = dict(re.findall(r"^\| `([\w.]+)` \| ?(.*?) ?\|", REFERENCE, flags=re.M))
    expected = {**dict(defaults()), **dict(defaults(Uav, "uavs.0.")), **dict(defaults(Cut, "network.cuts."))}
    assert set(listed) == set(expected)
    for key, default in expected.items():
        if default is None:
            assert listed[key] == "below"
        elif default is msgspec.NODEFAULT:
            assert listed[key] == ""
        else:
            value = tomllib.loads(f"value = {listed[key].strip('`')}")["value"]
            assert msgspec.convert(value, type(default)) == default, key


def test_every_key_and_option_says_its_meaning():
    page = REFERENCE + generator().options_table()
    rows = re.findall(r"^\| `([\w.]+)` \|.*\| ?(.*?) ?\|$", page, flags=re.M)
    assert len(rows) > 90
    for key, meaning in rows:
        assert len(meaning) > 3, key


def test_the_reference_writes_out_the_long_defaults():
    ((_, content),) = [block for block in blocks(REFERENCE) if block[0] == "toml"]
    assert decode(tomllib.loads(content)) == Scenario()


def test_the_overrides_of_the_reference_are_valid():
    ((_, content),) = [block for block in blocks(REFERENCE) if block[0] == "sh"]
    lines = [shlex.split(line, comments=True) for line in content.splitlines()]
    overrides = [[words[i + 1] for i, word in enumerate(words) if word == "--set"] for words in lines]
    assert list(map(len, overrides)) == [0, 1, 2, 1]
    for given in overrides:
        load("forest", given)


def test_no_placeholder_is_left():
    assert not re.search(r"\b[A-Z]+(_[A-Z]+)+\b|TODO|TBD", README)
