"""README, reference and every page: names, commands, keys and defaults exist, and each begins with an example."""

import importlib.util
import re
import shlex

import msgspec
import pytest
from helpers.pages import DOCS, PAGES, ROOT, blocks, commands, generator

import understory
from planning.catalogue import PLANNERS
from sim.__main__ import COMMANDS
from sim.scenario.camera_settings import CameraSettings
from sim.scenario.loading import decode, load
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import tomllib
from sim.scenario.uavs import Cut, Uav
from sim.terminal.commands import load_command
from tracking.navigation import Navigation

README = (ROOT / "README.md").read_text(encoding="utf-8")
REFERENCE = (ROOT / "docs" / "reference" / "scenarios.md").read_text(encoding="utf-8")
INSTALL = ("pip install -e . && understory run", "pip install -e '.[test]' && pytest")
KEYS = {key for key, _, _ in generator().keys()}
TEXTS = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]


def named(path):
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", TEXTS, ids=named)
def test_commands_have_the_options_that_the_page_gives_them(page, monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "examples" / "seedling"))  # is not installed
    for program, *words in commands(page.read_text(encoding="utf-8")):
        if program == "understory" and words and not words[0].startswith("-"):
            command = load_command(COMMANDS[words[0]][0])
            if "--help" not in words:
                command.make_context(words[0], list(words[1:]))
        elif program == "python" and words[0] == "-m":
            assert importlib.util.find_spec(words[1]), words
        elif program in ("python", "pytest") and "-c" not in words:
            paths = [word for word in words if "/" in word and not word.startswith("-")]
            assert all((ROOT / path).exists() for path in paths), words


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_tables_made_from_the_code_are_as_docs_generate_writes_them(page):
    text = page.read_text(encoding="utf-8")
    assert text == generator().generated(text)
    assert text.count("<!-- ") == 2 * text.count("<!-- end -->")


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_a_page_begins_with_its_purpose_and_an_example(page):
    head = "\n".join(page.read_text(encoding="utf-8").splitlines()[:14])
    assert head.startswith("# ") and re.search(r"^[A-Z`]", head.split("\n", 2)[2])
    assert re.search(r"^(```|    )\S*\n?", head, flags=re.M), "no example in the first lines"


@pytest.mark.parametrize("page", TEXTS, ids=named)
def test_names_of_modules_files_and_their_content_exist(page):
    text = page.read_text(encoding="utf-8")
    for name in set(re.findall(r"(?<![\w./-])(?:sim|planning|tracking)(?:\.[A-Za-z_]\w*)+(?![\w/])", text)):
        assert name in KEYS or resolved(name), name
    for path in set(re.findall(r"(?<![\w./-])(?:sim|planning|tracking|tests|docs|assets)/[\w./-]*\w", text)):
        assert (ROOT / path).exists(), path


def resolved(name):
    """True if a dotted name is one of a module, or of something in one."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        module = ROOT.joinpath(*parts[:k])
        if module.is_dir() or module.with_suffix(".py").is_file():
            if k == len(parts):
                return True
            found = importlib.import_module(".".join(parts[:k]))
            for part in parts[k:]:
                found = getattr(found, part, None) or getattr(found, "__annotations__", {}).get(part)
            return found is not None
    return False


def test_the_reference_has_every_name_command_and_option():
    text = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^::: understory\.(\w+)$", text, flags=re.M)) == sorted(understory.__all__)
    page = (DOCS / "reference" / "commands.md").read_text(encoding="utf-8")
    text = generator().commands_text()
    for name, (target, _) in COMMANDS.items():
        assert f"`{name}`" in page
        command = load_command(target)
        part = text.partition(f"## understory {name}\n")[2].partition("\n## ")[0]
        for parameter in command.params:
            assert (parameter.opts[0] if parameter.param_type_name == "option" else parameter.metavar) in part
            assert parameter.help and " ".join(parameter.help.split())[:20] in part


def test_the_readme_is_short_whole_and_has_the_commands_of_the_checks():
    assert README.count("\n") < 150
    for target in re.findall(r"\]\(([^)]+)\)", README):
        assert (ROOT / target).is_file(), target
    for name in re.findall(r"--planner ([a-z-]+)(?=\s|$)", README):
        assert name in PLANNERS
    assert not re.search(r"\b[A-Z]+(_[A-Z]+)+\b|TODO|TBD", README)
    checks = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for command in INSTALL:
        assert command in checks and ("sh", command + "\n") in blocks(README)


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
        key = prefix + field.encode_name
        if isinstance(field.type, type) and issubclass(field.type, msgspec.Struct):
            yield from defaults(field.type, f"{key}.")
        elif key in ("people.paths", "uavs"):
            yield key, None
        else:
            # None, UNSET and NaN stand for a default that depends on other keys.
            varies = field.default in (None, msgspec.UNSET) or field.default != field.default
            yield key, msgspec.NODEFAULT if varies else field.default
        if key == "uavs.0.camera":
            yield from defaults(CameraSettings, f"{key}.")


def test_the_reference_lists_every_key_with_meaning_default_and_overrides():
    listed = dict(re.findall(r"^\| `([\w.]+)` \| ?(.*?) ?\|", REFERENCE, flags=re.M))
    tables = {"": Scenario, "uavs.0.": Uav, "uavs.0.navigation.": Navigation, "network.cuts.": Cut}
    expected = {key: default for prefix, kind in tables.items() for key, default in defaults(kind, prefix)}
    assert set(listed) == set(expected)
    for key, default in expected.items():
        if default is None:
            assert listed[key] == "below"
        elif default is msgspec.NODEFAULT:
            assert listed[key] == ""
        else:
            value = tomllib.loads(f"value = {listed[key].strip('`')}")["value"]
            assert msgspec.convert(value, type(default)) == default, key
    page = REFERENCE + generator().options_table()
    rows = re.findall(r"^\| `([\w.]+)` \|.*\| ?(.*?) ?\|$", page, flags=re.M)
    assert len(rows) > 90
    for key, meaning in rows:
        assert len(meaning) > 3, key
    ((_, content),) = [block for block in blocks(REFERENCE) if block[0] == "toml"]
    assert decode(tomllib.loads(content)) == Scenario()
    ((_, content),) = [block for block in blocks(REFERENCE) if block[0] == "sh"]
    lines = [shlex.split(line, comments=True) for line in content.splitlines()]
    overrides = [[words[i + 1] for i, word in enumerate(words) if word == "--set"] for words in lines]
    assert list(map(len, overrides)) == [0, 1, 2, 1]
    for given in overrides:
        load("forest", given)
