"""README and scenario reference say what is so: every key and default is listed."""

import re
import shlex

import msgspec
from helpers.pages import ROOT, blocks, generator

from planning.registry import PLANNERS
from sim.scenario.fleet import Uav
from sim.scenario.loading import decode, load
from sim.scenario.network import Cut
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import tomllib

README = (ROOT / "README.md").read_text(encoding="utf-8")
REFERENCE = generator().generated((ROOT / "docs" / "reference" / "scenarios.md").read_text(encoding="utf-8"))
INSTALL = ("pip install -e . && understory run", "pip install -e '.[test]' && pytest")


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
