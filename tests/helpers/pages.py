"""Pages of the documentation: their blocks, and an executor that runs them as a notebook, in the test's process."""

import importlib.util
import re
import shlex
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from sim import __main__ as cli
from sim.study import pool
from sim.study.backends import Borrowed

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md"))
SHORTER = {"run": ["--duration", "1"], "compare": ["--duration", "1", "--seeds", "0,1"]}


def generator():
    """The module that makes parts of the site from the code, docs/generate.py."""
    spec = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def blocks(text):
    """Language and content of every fenced block."""
    return re.findall(r"^```(\w+)\n(.*?)^```$", text, flags=re.M | re.S)


def commands(text):
    """Every command line of a page, as words."""
    indented = re.findall(r"^    ((?:pytest|understory|python) .*)$", text, flags=re.M)
    lines = [line for language, content in blocks(text) if language == "sh" for line in content.splitlines()]
    joined = "\n".join([*lines, *indented]).replace("\\\n", " ")
    return [words for line in joined.splitlines() if (words := shlex.split(line, comments=True))]


def execute(markdown, name, monkeypatch, folder):
    """Run every cell of a page's notebook in a folder, missions shortened and flown in this process."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(pool, "Pool", _Here)
    monkeypatch.setattr(sys, "path", [str(folder), *sys.path])
    names = {"__name__": "notebook"}
    for cell in generator().notebook(markdown)["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            continue
        if source.startswith("%%writefile "):
            first, _, content = source.partition("\n")
            (folder / first.split()[1]).write_text(content + "\n", encoding="utf-8")
        elif source.startswith("!"):
            for line in source.splitlines():
                _command(shlex.split(line.removeprefix("!"), comments=True), monkeypatch)
        else:
            exec(compile(source, name, "exec"), names)


class _Here(Borrowed):
    """Stands for a pool of processes, as a process takes seconds to start; the pool's own tests start some."""

    def __init__(self, workers):
        super().__init__(ThreadPoolExecutor(1))

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._executor.shutdown()


def _command(words, monkeypatch):
    assert words[0] == "understory", words
    monkeypatch.setattr(sys, "argv", [*words, *SHORTER.get(words[1], [])])
    try:
        cli.main()
    except SystemExit as end:
        assert not end.code, words
