"""docs/examples: each script is short, says its idea and leaves what it says; all that users read uses public names."""

import ast
import re
from textwrap import dedent

import pytest
from helpers.pages import DOCS, PAGES, ROOT
from helpers.processes import python

import understory

SCRIPTS = sorted((DOCS / "examples").glob("*.py"))
INSIDE = ("sim", "planning", "tracking", "assets")


def idea_of(script):
    return ast.get_docstring(ast.parse(script.read_text(encoding="utf-8")))


@pytest.mark.docs
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_a_script_runs_in_an_empty_folder_and_leaves_what_it_says(script, tmp_path):
    if script.stem == "with_stable_baselines":
        pytest.importorskip("stable_baselines3")
    done = python(script, cwd=tmp_path, MPLBACKEND="Agg", PYTHONDONTWRITEBYTECODE="1")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {name for name in re.findall(r"`([\w.]+)`", idea_of(script)) if not hasattr(understory, name)}
    assert all(path.is_dir() or path.stat().st_size for path in tmp_path.rglob("*"))


def test_scripts_are_short_begin_with_their_idea_and_are_listed():
    listed = re.findall(r"^\| \[(\w+)\.py\]", (DOCS / "examples" / "README.md").read_text(encoding="utf-8"), flags=re.M)
    assert sorted(listed) == [script.stem for script in SCRIPTS] and len(listed) >= 15
    for script in SCRIPTS:
        assert script.read_text(encoding="utf-8").count("\n") <= 40, script
        assert 1 <= len(re.findall(r"\.(?:\s|$)", idea_of(script))) <= 2, script


def docstrings(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            yield ast.get_docstring(node) or ""


def sources():
    """Place and source of all Python that users read: pages, scripts and packages of examples, and docstrings."""
    pages = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    texts = [(page, page.read_text(encoding="utf-8")) for page in pages]
    modules = [ROOT / "understory.py", *(path for package in INSIDE for path in (ROOT / package).rglob("*.py"))]
    texts += [(path, text) for path in modules for text in docstrings(path)]
    for place, text in texts:
        yield from ((place, dedent(c)) for c in re.findall(r"^ *```py(?:thon)?\n(.*?)^ *```$", text, flags=re.M | re.S))
        yield place, "\n".join(re.findall(r"^ *(?:>>>|\.\.\.) ?(.*)$", text, flags=re.M))
    yield from ((path, path.read_text(encoding="utf-8")) for path in (DOCS / "examples").rglob("*.py"))


def names_in(source):
    """Dotted names that Python source imports, and those that it takes from `understory`."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "understory":
            yield f"understory.{node.attr}"


def test_pages_examples_and_docstrings_use_only_what_understory_exports():
    found = [(place, name.split(".")) for place, source in sources() for name in names_in(source)]
    assert len(found) > 100
    for place, (package, *names) in found:
        assert package not in INSIDE, (place, names)
        assert package != "understory" or set(names) <= set(understory.__all__), (place, names)
