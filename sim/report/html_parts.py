"""HTML of a report: the page, its tables and paragraphs."""

import re
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import NamedTuple


class Section(NamedTuple):
    """A part of the page."""

    heading: str
    html: str


def page(title: str, opening: str, sections: Sequence[Section]) -> str:
    """The page: the HTML before the contents, the contents, and the sections."""
    links = "\n".join(f'<a href="#section-{n}">{escape(s.heading)}</a>' for n, s in enumerate(sections, start=1))
    parts = [f'<h2 id="section-{n}">{escape(s.heading)}</h2>\n{s.html}' for n, s in enumerate(sections, start=1)]
    body = "\n".join([opening, f"<nav>\n{links}\n</nav>", *parts])
    template, style = ((files("sim.report") / name).read_text(encoding="utf-8") for name in ("page.html", "page.css"))
    return Template(template).substitute(title=escape(title), style=style.rstrip(), body=body)


def bullet_list(lines: Iterable[str]) -> str:
    """An HTML list of plain lines."""
    return "<ul>\n" + "\n".join(f"<li>{escape(line)}</li>" for line in lines) + "\n</ul>"


def paragraph(text: str, kind: str = "") -> str:
    """An HTML paragraph of plain text."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def command_line(text: str) -> str:
    """A command line that one click selects."""
    return f'<code class="command">{escape(text)}</code>'


def table(heads: Sequence[str], rows: Sequence[str], kind: str = "") -> str:
    """An HTML table from its headings and its rows of HTML."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    lines = "\n".join(_labelled(row, heads) for row in rows)
    text = f'<table class="{kind}"><thead><tr>{head}</tr></thead>\n<tbody>\n{lines}\n</tbody></table>'
    return f'<div class="wide">{text}</div>'


def _labelled(row: str, heads: Sequence[str]) -> str:
    """A row whose cells contain their headings, for narrow screens; cells that span columns have none."""
    names = iter(heads)
    return re.sub(r"<td\b(?! colspan)", lambda _: f'<td data-head="{escape(next(names))}"', row)
