"""docs/how-to/plugins.md: its planner flies, conforms and has the checks that are listed."""

import re
from pathlib import Path

from planning.conformance.checks import CHECKS

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "how-to" / "plugins.md").read_text(encoding="utf-8")


def test_the_planner_of_the_page_conforms_as_the_test_of_the_page_says(tmp_path, monkeypatch):
    planner, test = re.findall(r"^```python\n(.*?)^```$", PAGE, flags=re.M | re.S)
    (tmp_path / "myplanner.py").write_text(planner)
    monkeypatch.syspath_prepend(tmp_path)
    names = {}
    exec(compile(test, "plugins.md", "exec"), names)
    names["test_it_conforms"]()


def test_every_check_is_listed_in_its_order():
    rows = re.findall(r"^\| (`.*?`) \|", PAGE, flags=re.M)
    listed = [name for row in rows for name in re.findall(r"`(.*?)`", row)]
    assert listed == list(CHECKS)


def test_links_lead_somewhere():
    for page in (DOCS / "how-to" / "plugins.md", DOCS / "examples" / "shepherd" / "README.md"):
        for target in re.findall(r"\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
            file, _, heading = target.partition("#")
            assert (page.parent / file).is_file() or not file, target
            text = (page.parent / file if file else page).read_text(encoding="utf-8")
            headings = [line.lstrip("# ") for line in text.splitlines() if line.startswith("#")]
            assert not heading or heading in [line.lower().replace(" ", "-") for line in headings], target
