"""README, reference and every page: names, commands, keys and defaults exist, and each begins with an example."""

import ast
import importlib.util
import pkgutil
import re
import shlex
from collections import Counter

import pytest
from helpers.pages import DOCS, PAGES, ROOT, blocks, commands, generator, text_of

import understory
from planning.catalogue import PLANNERS
from planning.planner_check import CHECKS
from sim.__main__ import COMMANDS
from sim.scenario.loading import decode, load_scenario
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import tomllib
from sim.sensing.detector_check import check_detector
from sim.terminal.commands import load_command
from tracking.fusion.rule import LocalBeliefs
from tracking.fusion.tracker_check import check_tracker

README = (ROOT / "README.md").read_text(encoding="utf-8")
INSTALL = ("pip install -e . && understory run", "pip install -e '.[test]' && pytest")
KEYS = {key for key, _, _ in generator().keys()}
MAKES = ast.FunctionDef | ast.ClassDef
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
        elif program in ("cp", "python", "pytest") and "-c" not in words:
            paths = [word for word in words if "/" in word and not word.startswith("-")]
            assert all((ROOT / path).exists() for path in paths), words


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_a_page_begins_with_its_purpose_and_an_example_and_has_the_tables_of_the_code(page):
    text = page.read_text(encoding="utf-8")
    head = "\n".join(text.splitlines()[:14])
    assert head.startswith("# ") and re.search(r"^[A-Z`]", head.split("\n", 2)[2])
    assert re.search(r"^(```|    )\S*\n?", head, flags=re.M), "no example in the first lines"
    assert text == generator().generated(text)
    assert text.count("<!-- ") == 2 * text.count("<!-- end -->")


@pytest.mark.parametrize("page", TEXTS, ids=named)
def test_names_of_modules_files_and_their_content_exist(page):
    text = page.read_text(encoding="utf-8")
    names = r"(?<![\w./-])(?:sim|planning|tracking)(?:\.[A-Za-z_]\w*)+(?![\w/])"
    for name in set(re.findall(names, text)) - KEYS:
        pkgutil.resolve_name(name)
    assert set(re.findall(r"`understory\.(\w+)", text)) - {"py"} <= set(understory.__all__)
    for path in set(re.findall(r"(?<![\w./-])(?:sim|planning|tracking|tests|docs|assets)/[\w./-]*\w", text)):
        assert (ROOT / path).exists(), path


def test_the_reference_has_every_name_command_and_option():
    found = re.findall(r"^### understory\.(\w+)$", text_of("reference/api"), flags=re.M)
    assert sorted(found) == sorted(understory.__all__)
    page, text = text_of("reference/commands"), generator().commands_text()
    for name, (target, _) in COMMANDS.items():
        assert f"`{name}`" in page
        part = text.partition(f"## understory {name}\n")[2].partition("\n## ")[0]
        for parameter in load_command(target).params:
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


@pytest.mark.parametrize(("needed", "found"), [("", "chromium"), ("1", "chromium"), ("", None), ("1", None)])
def test_pages_are_tested_in_a_browser_or_skipped_and_where_one_is_needed_they_fail(
    monkeypatch, tmp_path, needed, found
):
    monkeypatch.setattr("shutil.which", lambda name: found if name == found else None)
    monkeypatch.delenv("BROWSER_NEEDED", raising=False)
    if needed:
        monkeypatch.setenv("BROWSER_NEEDED", needed)
    spec = importlib.util.find_spec("helpers.browser")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.needs_browser.args == (not needed and found is None,)
    if found is None:
        with pytest.raises(AssertionError, match="no Chromium"):
            module.Browser(tmp_path)


def test_every_key_of_literature_is_resolved():
    used = set()
    for package in ("sim", "planning", "tracking", "assets"):
        for path in (ROOT / package).rglob("*.py"):
            used |= set(re.findall(r"\[([A-Z][A-Za-z]+\d\d)\]", path.read_text(encoding="utf-8")))
    assert "Li22" in used
    assert used <= set(re.findall(r"^- \[(\w+)\]", text_of("reference/sources"), flags=re.M))


def test_the_reference_lists_every_key_and_option_with_a_meaning_and_overrides_that_load():
    """That its tables are those of the code, with their defaults, is tested above."""
    page = text_of("reference/scenarios")
    assert set(re.findall(r"^\| `([\w.]+)` \|", page, flags=re.M)) == KEYS
    rows = re.findall(r"^\| `([\w.]+)` \|.*\| ?(.*?) ?\|$", page + generator().options_table(), flags=re.M)
    assert len(rows) > 90 and all(len(meaning) > 3 for _, meaning in rows)
    ((_, content),) = [block for block in blocks(page) if block[0] == "toml"]
    assert decode(tomllib.loads(content)) == Scenario()
    ((_, content),) = [block for block in blocks(page) if block[0] == "sh"]
    lines = [shlex.split(line, comments=True) for line in content.splitlines()]
    overrides = [[words[i + 1] for i, word in enumerate(words) if word == "--set"] for words in lines]
    assert list(map(len, overrides)) == [0, 1, 2, 1]
    for given in overrides:
        load_scenario("forest", given)


def listed(page, before, after="\n\n"):
    """Names in the first column of a table, whose second column says something of each."""
    rows = re.findall(r"^\| (`.*?`) \| \S", text_of(page).partition(before)[2].partition(after)[0], flags=re.M)
    return [name for row in rows for name in re.findall(r"`(.*?)`", row)]


def test_every_check_and_all_that_a_fusion_rule_is_given_are_listed():
    assert listed("how-to/planners", "## Does it conform?", "\n#") == list(CHECKS)
    assert listed("how-to/plugins", "| check of a detector |") == [f.check for f in check_detector("blob")]
    assert listed("how-to/trackers", "| check of a tracker |") == [f.check for f in check_tracker("jpda")]
    assert set(listed("how-to/plugins", "| of `local` |")) == set(LocalBeliefs._fields)


def test_the_page_of_helpers_names_every_module_with_what_it_holds_and_tests_use_all_of_it():
    folder = ROOT / "tests" / "helpers"
    page, modules = (folder / "README.md").read_text(encoding="utf-8"), sorted(folder.glob("*.py"))
    rows = re.findall(r"^\| `(\w+)` \| (.+?) \|$", page, flags=re.M)
    assert [name for name, _ in rows] == [path.stem for path in modules if path.stem != "__init__"]
    assert min(len(holds.split()) for _, holds in rows) > 1
    words = Counter(re.findall(r"\w+", "".join(path.read_text("utf-8") for path in (ROOT / "tests").rglob("*.py"))))
    for path in modules:
        made = [node.name for node in ast.parse(path.read_text("utf-8")).body if isinstance(node, MAKES)]
        assert [name for name in made if words[name] == 1] == [], path.name
