"""Every page: its commands and names exist, and it begins with an example."""

import importlib.util
import re

import pytest
from helpers.pages import DOCS, PAGES, ROOT, commands, generator
from typer.main import get_command

import understory
from sim.__main__ import app

TEXTS = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]


def named(path):
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", TEXTS, ids=named)
def test_commands_have_the_options_that_the_page_gives_them(page):
    group = get_command(app)
    for program, *words in commands(page.read_text(encoding="utf-8")):
        if program == "understory" and words and not words[0].startswith("-"):
            command = group.commands[words[0]]
            if "--help" not in words:
                command.make_context(words[0], list(words[1:]))
        elif program == "python" and words[0] == "-m":
            assert importlib.util.find_spec(words[1]), words
        elif program in ("python", "pytest") and "-c" not in words:
            paths = [word for word in words if "/" in word and not word.startswith("-")]
            assert all((ROOT / path).exists() for path in paths), words


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_a_page_begins_with_its_purpose_and_an_example(page):
    head = "\n".join(page.read_text(encoding="utf-8").splitlines()[:14])
    assert head.startswith("# ") and re.search(r"^[A-Z`]", head.split("\n", 2)[2])
    assert re.search(r"^(```|    )\S*\n?", head, flags=re.M), "no example in the first lines"


@pytest.mark.parametrize("page", TEXTS, ids=named)
def test_names_of_modules_files_and_their_content_exist(page):
    keys = {key for key, _, _ in generator().keys()}
    text = page.read_text(encoding="utf-8")
    for name in set(re.findall(r"(?<![\w./-])(?:sim|planning|tracking)(?:\.[A-Za-z_]\w*)+(?![\w/])", text)):
        assert name in keys or resolved(name), name
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


def test_the_reference_has_every_name_of_the_interface():
    text = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^::: understory\.(\w+)$", text, flags=re.M)) == sorted(understory.__all__)


def test_the_reference_has_every_command_and_option():
    text = generator().commands_text()
    for name, command in get_command(app).commands.items():
        part = text.partition(f"## understory {name}\n")[2].partition("\n## ")[0]
        for parameter in command.params:
            assert (parameter.opts[0] if parameter.param_type_name == "option" else parameter.metavar) in part
            assert parameter.help and " ".join(parameter.help.split())[:20] in part
