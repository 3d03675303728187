"""Parts of pages that are made from the code, and of the site from pages: tables, equations, notebooks.

`python docs/generate.py` writes tables of reference and results. That of some keys of a scenario stands between the
lines `<!-- keys: trees -->` and `<!-- end -->`. Others begin with `<!-- planners -->`, `<!-- metrics -->` and, of the
default planner or of one that is named, `<!-- planner options -->`; those of `scores.py` and `board.py` with
`<!-- gaps: METRIC -->` and `<!-- board -->`; signatures and docstrings of what `understory` exports with
`<!-- api: run compare -->`. MkDocs calls the functions
`on_...`: `{{ commands }}` becomes the help of all commands, a formula between `$$` becomes MathML, and each tutorial is
written as a notebook, too.
"""

import ast
import inspect
import json
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import msgspec

import understory
from planning.catalogue import DEFAULT_PLANNER, PLANNERS, import_planner
from sim.facts.metrics.catalogue import METRICS
from sim.scenario.camera_settings import CameraSettings
from sim.scenario.environment import Appearance
from sim.scenario.scenario import ScenarioSettings
from sim.scenario.settings_text import format_value
from sim.scenario.uavs import Cut, UavSettings
from tracking.navigation import Navigation

DOCS = Path(__file__).parent
sys.path.append(str(DOCS))
_WRITTEN_OUT = ("people.paths", "uavs")  # long defaults, which the page itself shows
_ROWS = {
    "uavs": ("uavs.0", UavSettings),
    "uavs.0.navigation": ("uavs.0.navigation", Navigation),
    "uavs.0.camera": ("uavs.0.camera", CameraSettings),
    "network.cuts": ("network.cuts", Cut),
    "appearance": ("appearance", Appearance),
}
_FENCE = re.compile(r"^```(\w+)\n(.*?)^```\n?", flags=re.M | re.S)


def on_page_markdown(markdown: str, page: Any, **_: object) -> str:  # noqa: ANN401 - MkDocs' page
    """The page with its formulas, the commands and the link to its notebook."""
    if page.file.src_uri.startswith("tutorials/"):
        name = Path(page.file.src_uri).with_suffix(".ipynb").name
        markdown = markdown.replace("\n", f"\n\n[As a notebook]({name}){{ download }}\n", 1)
    if page.file.src_uri == "reference/commands.md":
        markdown = markdown.replace("{{ commands }}", commands_text())
    return math(markdown)


def on_files(files: Any, config: Any, **_: object) -> Any:  # noqa: ANN401 - MkDocs' own
    """The files of the site, with a notebook beside each tutorial."""
    from mkdocs.structure.files import File

    for file in [f for f in files.documentation_pages() if f.src_uri.startswith("tutorials/")]:
        name = str(Path(file.src_uri).with_suffix(".ipynb"))
        files.append(File.generated(config, name, content=json.dumps(notebook(file.content_string), indent=1)))
    return files


def generated(markdown: str) -> str:
    """A page with the tables that its marks ask for."""
    from board import ENTRIES, make_table
    from scores import gaps_table

    makers = {"keys": keys_table, "planners": planners_table}
    makers |= {"planner options": options_table, "gaps": gaps_table, "metrics": metrics_table, "api": api_text}
    makers |= {"board": lambda: make_table(sorted(file.parent for file in ENTRIES.glob("*/entry.toml")))}

    def made(mark: re.Match[str]) -> str:
        table = makers[mark[2]](*(mark[3] or "").split())
        return f"{mark[1]}\n\n{table}\n\n<!-- end -->"

    mark = r"^(<!-- ([a-z ]+)(?:: ([\w. -]+))? -->)\n.*?^<!-- end -->$"
    return re.sub(mark, made, markdown, flags=re.M | re.S)


def keys(kind: type = ScenarioSettings, prefix: str = "") -> Iterator[tuple[str, msgspec.structs.FieldInfo, str]]:
    """Every key of a scenario, its field, and the comment on the field in the code."""
    meanings, tables = _comments(kind), []
    for field in msgspec.structs.fields(kind):
        key = prefix + field.encode_name
        if isinstance(field.type, type) and issubclass(field.type, msgspec.Struct):
            yield from keys(field.type, f"{key}.")
            continue
        yield key, field, meanings.get(field.name, "")
        if key in _ROWS:
            tables.append(_ROWS[key])
    for place, row in tables:
        yield from keys(row, f"{place}.")


def keys_table(*tables: str) -> str:
    """Keys of tables of a scenario, those of none as `mission`: default, bounds, unit and meaning."""
    lines = ["| key | default | allowed | unit and meaning |", "|---|---|---|---|"]
    for key, field, meaning in keys():
        table = key.rpartition(".")[0] or (key if key in _ROWS else "mission")
        if table in tables:
            lines.append(f"| `{key}` | {_default(key, field)} | {_limits(field.type)} | {meaning} |")
    return "\n".join(lines)


def planners_table() -> str:
    """The planners that come with the testbed."""
    rows = [f"| `{name}` | {spec.summary} |" for name, spec in PLANNERS.items()]
    return "\n".join(["| planner | meaning |", "|---|---|", *rows])


def metrics_table() -> str:
    """Every metric of the catalogue, by its key in `summary.json` and in studies."""
    rows = [f"| `{name}` | {known.unit} | {known.meaning} |" for name, known in METRICS.items()]
    return "\n".join(["| key | shown in | what |", "|---|---|---|", *rows])


def options_table(planner: str = DEFAULT_PLANNER) -> str:
    """Options of a planner and of others of its class: default, that of these where it differs, and meaning."""
    kind = import_planner(PLANNERS[planner])
    alike = {name: spec.options for name, spec in PLANNERS.items() if spec.target == PLANNERS[planner].target}
    lines, meanings = ["| option | default | meaning |", "|---|---|---|"], _comments(kind)
    for name, parameter in inspect.signature(kind).parameters.items():
        others: dict[str, list[str]] = {}
        for alias, options in alike.items():
            if name in options:
                others.setdefault(repr(options[name]), []).append(f"`{alias}`")
        values = [f"`{parameter.default!r}`", *(f"`{value}` in {', '.join(names)}" for value, names in others.items())]
        lines.append(f"| `{name}` | {'; '.join(values)} | {meanings.get(name, '')} |")
    return "\n".join(lines)


def commands_text() -> str:
    """Every command with its arguments and options."""
    from sim.__main__ import COMMANDS
    from sim.terminal.commands import load_command

    parts = []
    for name, (target, _) in sorted(COMMANDS.items()):
        command = load_command(target)
        parts += [f"## understory {name}", "", inspect.cleandoc(command.help or ""), ""]
        parts += ["| argument or option | meaning |", "|---|---|"] if command.params else []
        for parameter in command.params:
            options = "/".join([*parameter.opts, *parameter.secondary_opts])
            value = "" if getattr(parameter, "is_flag", False) else f" {parameter.metavar or ''}"
            written = parameter.metavar or options if parameter.param_type_name == "argument" else options + value
            default = "" if parameter.default in (None, False) or callable(parameter.default) else parameter.default
            shown = " Required." if parameter.required else f" Default: `{default}`." if default != "" else ""
            parts.append(f"| `{written.replace('|', chr(92) + '|')}` | {_escaped(parameter.help or '')}{shown} |")
        parts.append("")
    return "\n".join(parts).rstrip("\n")


def api_text(*names: str) -> str:
    """Signature and docstring of names that `understory` exports, and of the methods and properties of classes."""
    return "\n\n".join(part for name in names for part in _describe(name, getattr(understory, name)) if part)


def _describe(name: str, value: Any) -> Iterator[str]:  # noqa: ANN401 - anything that is exported
    value = getattr(value, "py_func", value)  # of a compiled function
    yield f"### understory.{name}"
    if not inspect.isclass(value) and not inspect.isfunction(value):
        imports = [node for node in ast.parse(inspect.getsource(understory)).body if isinstance(node, ast.ImportFrom)]
        (home,) = [node.module for node in imports if name in [alias.name for alias in node.names]]
        lines = inspect.getsource(sys.modules[home]).splitlines()
        (at,) = [number for number, line in enumerate(lines, 1) if line.startswith(f"{name} = ")]
        yield _fenced(lines[at - 1].partition("  # ")[0])
        yield field_comment(lines, at, at)
        return
    (node,) = ast.parse(textwrap.dedent(inspect.getsource(value))).body
    if isinstance(node, ast.FunctionDef):
        yield _fenced(_signature(node))
        yield _markdown(node)
        return
    assert isinstance(node, ast.ClassDef)
    methods = [part for part in node.body if isinstance(part, ast.FunctionDef)]
    lines, shown = textwrap.dedent(inspect.getsource(value)).splitlines(), []
    for part in node.body:
        if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name) and part.target.id[0] != "_":
            comment = textwrap.wrap(field_comment(lines, part.lineno, part.end_lineno or part.lineno), 94)
            shown += [*(f"# {line}" for line in comment), ast.unparse(part)]
    shown += [_signature(part) for part in methods if part.name == "__init__"]
    yield _fenced("\n".join([f"class {name}:", textwrap.indent("\n".join(shown or ["..."]), "    ")]))
    yield _markdown(node)
    for part in methods:
        if not part.name.startswith("_"):
            yield f"#### {name}.{part.name}"
            yield _fenced(_signature(part))
            yield _markdown(part)


def _signature(function: ast.FunctionDef) -> str:
    """Signature as in a stub; too long for a line, with a line for each parameter."""
    given, values = function.args, [*function.args.defaults]
    named = [*given.posonlyargs, *given.args]
    defaults = [None] * (len(named) - len(values)) + values
    parts = [_parameter(*pair) for pair in zip(named, defaults, strict=True)]
    if given.vararg or given.kwonlyargs:
        parts.append("*" + (_parameter(given.vararg) if given.vararg else ""))
    parts += [_parameter(*pair) for pair in zip(given.kwonlyargs, given.kw_defaults, strict=True)]
    parts += ["**" + _parameter(given.kwarg)] if given.kwarg else []
    kinds = [re.sub(r"cached_property", "property", ast.unparse(mark)) for mark in function.decorator_list]
    marks = "".join(f"@{kind}\n" for kind in kinds if kind in ("property", "classmethod", "staticmethod"))
    result = f" -> {ast.unparse(function.returns)}" if function.returns else ""
    line = f"def {function.name}({', '.join(parts)}){result}: ..."
    if len(line) > 100:
        line = "\n".join([f"def {function.name}(", *(f"    {part}," for part in parts), f"){result}: ..."])
    return marks + line


def _parameter(arg: ast.arg, default: ast.expr | None = None) -> str:
    value = f" = {ast.unparse(default)}" if default else ""
    return f"{arg.arg}: {ast.unparse(arg.annotation)}{value}" if arg.annotation else arg.arg + value.replace(" ", "")


def _fenced(code: str) -> str:
    return f"```py\n{code}\n```"


def _markdown(node: ast.FunctionDef | ast.ClassDef) -> str:
    """A docstring as Markdown: sections as lists, examples as blocks."""
    text = inspect.cleandoc(ast.get_docstring(node) or "")
    made, listing = [], False
    for line in text.splitlines():
        if section := re.match(r"(Args|Attributes|Returns|Raises|Yields|Example):$", line):
            listing = section[1] not in ("Returns", "Yields", "Example")
            made += [f"**{section[1]}:**", ""]
        elif line.startswith("    "):
            item = re.match(r"    (\w+): (.*)", line) if listing else None
            made.append(
                f"- `{item[1]}`: {item[2]}" if item else ("  " * listing + line.strip() if listing else line[4:])
            )
        else:
            made.append(line)
    return "\n".join(made)


def math(markdown: str) -> str:
    """A page with its formulas as MathML, which browsers draw: `$$...$$`, and on such a page `$...$`."""
    if "$$" not in markdown:
        return markdown
    from latex2mathml.converter import convert

    def drawn(formula: re.Match[str]) -> str:
        block, inline = formula.groups()
        text = " ".join((block or inline).split()).replace("pmatrix", "matrix")  # style.css draws the brackets
        return f'<div class="formula">{convert(text, display="block")}</div>' if block else convert(text)

    markdown = re.sub(r"(?<=[^\n])\n(?=\$[^$])", " ", markdown)  # a line that begins with a tag is a paragraph
    return re.sub(r"\$\$(.+?)\$\$|\$([^$\n]+)\$", drawn, markdown, flags=re.S)


def notebook(markdown: str) -> dict[str, Any]:
    """A page as a notebook: commands with an exclamation mark, Python as it stands, files by `%%writefile`.

    A Python block whose first line is a comment with the name of a file, `# myplanner.py`, is such a file, as is TOML.
    """
    cells, end = [], 0
    for block in _FENCE.finditer(markdown):
        cells += _prose(markdown[end : block.start()])
        language, code, end = block[1], block[2].rstrip("\n"), block.end()
        file = re.match(r"# (\w+\.(?:py|toml))\n", code)
        if language == "sh":
            cells.append(_cell("code", "\n".join(f"!{line}" for line in code.splitlines())))
        elif file:
            cells.append(_cell("code", f"%%writefile {file[1]}\n{code}"))
        elif language == "python":
            cells.append(_cell("code", code))
        else:
            cells += _prose(block[0])
    cells += _prose(markdown[end:])
    about = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return {"cells": cells, "metadata": about, "nbformat": 4, "nbformat_minor": 4}


def _prose(text: str) -> list[dict[str, Any]]:
    return [_cell("markdown", text.strip())] if text.strip() else []


def _cell(kind: str, source: str) -> dict[str, Any]:
    extra = {"execution_count": None, "outputs": []} if kind == "code" else {}
    return {"cell_type": kind, "metadata": {}, "source": source.splitlines(keepends=True), **extra}


def field_comment(lines: list[str], first: int, last: int) -> str:
    """The comment on a field that stands in the given lines of a source, counted from 1: above it and behind it."""
    found = []
    for line in reversed(lines[: first - 1]):
        if not line.strip().startswith("# "):
            break
        found.insert(0, line.strip().removeprefix("# "))
    code, mark, behind = lines[last - 1].rpartition("  # ")
    text = behind.partition("  # noqa")[0] if mark and code and not behind.startswith("type: ignore") else ""
    return " ".join([*found, *([text] if text else [])])


def _comments(kind: type) -> dict[str, str]:
    """The comment on each field of a class; that of a class before those of its bases."""
    found: dict[str, str] = {}
    for part in reversed(kind.__mro__):
        if "__annotations__" not in vars(part) or part.__module__.startswith("msgspec"):
            continue
        source = textwrap.dedent(inspect.getsource(part))
        (node,) = ast.parse(source).body
        for field in [field for field in node.body if isinstance(field, ast.AnnAssign)]:
            found[field.target.id] = field_comment(source.splitlines(), field.lineno, field.end_lineno)
    return found


def _default(key: str, field: msgspec.structs.FieldInfo) -> str:
    if key in _WRITTEN_OUT:
        return "below"
    if field.default in (msgspec.NODEFAULT, None):
        return ""
    return f"`{format_value(field.default) if not isinstance(field.default, str) else json.dumps(field.default)}`"


def _limits(kind: Any) -> str:  # noqa: ANN401 - a type
    """The bounds of a number, in words; empty if there are none."""
    if get_origin(kind) in (Union, UnionType):
        return next(filter(None, map(_limits, get_args(kind))), "")
    inner, *metas = get_args(kind) if get_origin(kind) is Annotated else [kind]
    if not metas or inner not in (int, float):
        return ""
    (meta,) = metas
    least = f"{meta.ge:g}" if meta.ge is not None else f"above {meta.gt:g}" if meta.gt is not None else ""
    most = f"{meta.le:g}" if meta.le is not None else f"below {meta.lt:g}" if meta.lt is not None else ""
    comma = "," if least.startswith("above") else ""
    return f"{least}{comma} to {most}".strip() if most else f"{least} or more"


def _escaped(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|").replace("<", "&lt;")


if __name__ == "__main__":
    for page in [*DOCS.glob("reference/*.md"), *DOCS.glob("results/*.md")]:
        page.write_text(generated(page.read_text(encoding="utf-8")), encoding="utf-8")
