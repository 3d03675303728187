"""The site: it builds strictly, offline and without a warning, with a notebook beside each tutorial."""

import json

import pytest
from helpers.pages import DOCS, PAGES
from helpers.processes import python

pytest.importorskip("mkdocs")


@pytest.mark.docs
def test_the_site_builds_without_a_warning(tmp_path):
    words = ["-m", "mkdocs", "build", "--strict", "-d", str(tmp_path / "site")]
    done = python(*words, http_proxy="http://127.0.0.1:9", https_proxy="http://127.0.0.1:9")
    told = done.stdout + done.stderr
    assert done.returncode == 0, told
    assert all(line.startswith("INFO") for line in told.splitlines() if line.strip()), told
    for page in PAGES:
        place = page.relative_to(DOCS).with_suffix(".html")
        built = tmp_path / "site" / (place.with_name("index.html") if place.stem == "README" else place)
        text = built.read_text(encoding="utf-8")
        assert "$$" not in text and 'src="http' not in text
    commands = (tmp_path / "site" / "reference" / "commands.html").read_text(encoding="utf-8")
    assert "{{" not in commands and "--no-video" in commands and 'id="understory-compare"' in commands
    made = sorted((tmp_path / "site" / "tutorials").glob("*.ipynb"))
    assert [path.stem for path in made] == sorted(p.stem for p in (DOCS / "tutorials").glob("*.md"))
    assert all(json.loads(path.read_text(encoding="utf-8"))["nbformat"] == 4 for path in made)
