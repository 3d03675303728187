"""Every page: its commands and names exist, it begins with an example, and its blocks run."""

import importlib.util
import re
from functools import partial

import pytest
from helpers.pages import DOCS, PAGES, ROOT, SHORTER, blocks, commands, execute, generator
from typer.main import get_command

import understory
from planning.conformance import checks
from sim.__main__ import app

TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))
# The blocks of the other pages are run by tests of their own, beside this file and in the folders of the code.
RUN_HERE = [
    DOCS / "index.md",
    DOCS / "how-to" / "wrapping.md",
    DOCS / "reference" / "api.md",
    DOCS / "reference" / "figures.md",
    DOCS / "reference" / "planners.md",
    DOCS / "explanation" / "equations.md",
]
TEXTS = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]


def named(path):
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", [p for p in TUTORIALS if p.stem != "lost-person"], ids=named)
def test_a_tutorials_notebook_runs(page, tmp_path, monkeypatch):
    # Planning in another process is tried by the checks' own tests, and by the page on wrapping.
    monkeypatch.setattr(checks, "check", partial(checks.check, other_process=False))
    execute(page.read_text(encoding="utf-8"), named(page), monkeypatch, tmp_path)


@pytest.mark.parametrize("page", RUN_HERE, ids=named)
def test_a_pages_blocks_run(page, tmp_path, monkeypatch):
    execute(page.read_text(encoding="utf-8"), named(page), monkeypatch, tmp_path)


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


def test_a_notebook_holds_the_blocks_of_its_page_in_order():
    page = (DOCS / "tutorials" / "your-world.md").read_text(encoding="utf-8")
    cells = [cell for cell in generator().notebook(page)["cells"] if cell["cell_type"] == "code"]
    shown = [content for language, content in blocks(page) if language in ("sh", "python", "toml")]
    for cell, content in zip(cells, shown, strict=True):
        source = "".join(cell["source"]).removeprefix("%%writefile clearing.toml\n")
        assert re.sub(r"^!", "", source, flags=re.M) == content.rstrip("\n")
    assert set(SHORTER) == {"run", "compare"}


@pytest.mark.slow
def test_notebooks_run_in_a_kernel(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    for page in (p for p in TUTORIALS if p.stem != "lost-person"):
        made = nbformat.from_dict(generator().notebook(page.read_text(encoding="utf-8")))
        nbclient.NotebookClient(made, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
