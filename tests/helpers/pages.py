"""Pages of the documentation: their blocks, and a shell that runs these in the test's process."""

import importlib
import importlib.util
import re
import shlex
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

from helpers.commands import called
from sim.terminal import console

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md"))
SHORTER = {"run": ["--duration", "1"], "compare": ["--duration", "1", "--seeds", "0,1"]}


def text_of(name):
    """A page of the documentation by its path without ending."""
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


@cache
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


class Shell:
    """Commands and cells of pages, run in this process and in a folder, where studies fly, too."""

    def __init__(self, folder, monkeypatch, capsys):
        self.folder, self._monkeypatch, self._capsys = folder, monkeypatch, capsys
        self.told = []  # lines of output of the commands
        monkeypatch.chdir(folder)
        monkeypatch.delenv("DISPLAY", raising=False)
        monkeypatch.setattr(sys, "path", [str(folder), *sys.path])
        monkeypatch.setattr(console.console, "width", 200)

    def call(self, *arguments):
        """Exit code, standard output and standard error of `understory`."""
        return called(arguments, self._monkeypatch, self._capsys, ThreadPoolExecutor(1))

    def line(self, text, *options):
        """Output of a line of a page, with further options, or others than it gives; a window has no display here."""
        program, *words = shlex.split(text, comments=True)
        for name in {"--duration", "--seeds", "--time", "--no-video"}.intersection(words, options):
            at = words.index(name)
            del words[at : at + 1 + (name != "--no-video")]
        code, out, err = self.call(*words, *options)
        assert (program, code) == ("understory", 2 * ("--gui" in words)), (text, err)
        self.told += [line.rstrip() for line in out.splitlines()]
        return out

    def execute(self, markdown, name, shorter=SHORTER):
        """Names after every cell of a page's notebook was run, with options that shorten missions and times."""
        names = {"__name__": "notebook"}
        for cell in generator().notebook(markdown)["cells"]:
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                continue
            if source.startswith("%%writefile "):
                first, _, content = source.partition("\n")
                (self.folder / first.split()[1]).write_text(content + "\n", encoding="utf-8")
            elif source.startswith("!"):
                for line in source.splitlines():
                    self._shortened(line.removeprefix("!"), shorter)
            else:
                exec(compile(source, name, "exec"), names)
        return names

    def _shortened(self, line, shorter):
        command = line.rpartition(" && ")[2]
        if command.startswith("cp "):
            _, source, name = command.split()
            shutil.copy(ROOT / source, self.folder / name)
        elif command.startswith("python -m "):
            _, _, module, *words = command.split()
            importlib.import_module(module).main([*words, *shorter["-m"]])
        elif command.split()[0] not in ("pytest", "pip"):
            options = shorter.get(command.split()[1], [])
            self.line(command, *(options if "--time" not in options or "--time" in command else []))
