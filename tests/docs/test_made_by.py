"""docs/results/tables.md names what makes the tables, as the pages with these tables do."""

import re

from helpers.pages import DOCS

PAGE = (DOCS / "results" / "tables.md").read_text("utf-8")
ROWS = re.findall(r"^\| \[[^\]]+\]\(([^)#]+)[^)]*\)[^|]*\| ([^|]+) \|", PAGE, flags=re.MULTILINE)


def test_each_page_has_the_commands_that_make_its_tables():
    assert len(ROWS) > 10
    for page, makers in ROWS:
        text = (DOCS / "results" / page).resolve().read_text("utf-8")
        if page == "../index.md":
            text = (DOCS.parent / "README.md").read_text("utf-8")
        words = " ".join(text.replace("\\\n", " ").split())
        commands = re.findall(r"`([^`]+)`", makers)
        assert commands, page
        for command in commands:
            script = command.split()[1] if command.startswith("python ") else ""
            assert (DOCS.parent / script).is_file() if script else command in words, (page, command)


def test_each_page_of_results_is_listed():
    listed = {page for page, _ in ROWS}
    assert {file.name for file in (DOCS / "results").glob("*.md")} - {"tables.md"} <= listed
