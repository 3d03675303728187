"""docs/explanation: the tests that the tables of rules name exist, each once."""

import ast
import re

import pytest
from helpers.pages import DOCS, ROOT

HEAD = "| rule | test that fails without it |\n|---|---|\n"


def listed(page):
    """Rules and names of tests in the table of a page."""
    _, head, rest = (DOCS / "explanation" / page).read_text(encoding="utf-8").partition(HEAD)
    assert head, f"{page} has no table of rules"
    lines = rest.partition("\n\n")[0].splitlines()
    return [re.fullmatch(r"\| (.+) \| `(test_\w+)` \|", line).groups() for line in lines]


@pytest.fixture(scope="module")
def tests():
    """Names of all tests of the tracker and of missions."""
    paths = [path for package in ("tracking", "sim") for path in (ROOT / "tests" / package).rglob("test_*.py")]
    nodes = [node for path in paths for node in ast.parse(path.read_text(encoding="utf-8")).body]
    return [node.name for node in nodes if isinstance(node, ast.FunctionDef)]


@pytest.mark.parametrize("page", ["fusion.md", "tracks.md"])
def test_every_test_that_a_table_of_rules_names_exists_once(page, tests):
    rules = listed(page)
    assert rules and len({rule for rule, _ in rules}) == len(rules)
    for rule, name in rules:
        assert tests.count(name) == 1, (rule, name)
