"""HTML of a report: the page, its tables and paragraphs."""

import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from itertools import groupby
from string import Template

from sim.study.analysis.labels import cell_text
from sim.study.report.tables import Table


def make_page(title: str, opening: str, sections: Mapping[str, str]) -> str:
    """The page: the HTML before the contents, the contents, and the HTML of each section that has any, by heading."""
    shown = [(f"section-{n}", heading) for n, heading in enumerate(filter(sections.get, sections), start=1)]
    links = "\n".join(f'<a href="#{name}">{escape(heading)}</a>' for name, heading in shown)
    parts = [f'<h2 id="{name}">{escape(heading)}</h2>\n{sections[heading]}' for name, heading in shown]
    body = "\n".join([opening, f"<nav>\n{links}\n</nav>", *parts])
    template, style = (
        (files("sim.study.report") / name).read_text(encoding="utf-8") for name in ("page.html", "page.css")
    )
    return Template(template).substitute(title=escape(title), style=style.rstrip(), body=body)


def make_bullet_list(lines: Iterable[str]) -> str:
    """An HTML list of plain lines."""
    return "<ul>\n" + "\n".join(f"<li>{escape(line)}</li>" for line in lines) + "\n</ul>"


def make_paragraph(text: str, kind: str = "") -> str:
    """An HTML paragraph of plain text."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def make_command_line(text: str) -> str:
    """A command line that one click selects."""
    return f'<code class="command">{escape(text)}</code>'


def make_titled_tables(tables: Iterable[Table]) -> str:
    """Tables under their titles, which say which direction of the metric is better."""
    parts = []
    for table in tables:
        better = table.metric.better if table.metric else "neither"
        aim = f'<span class="soft">: {better} is better</span>' if better != "neither" else ""
        parts.append(f"<h3>{escape(table.title)}{aim}</h3>\n{make_html_table(table)}")
    return "\n".join(parts)


def make_html_table(table: Table) -> str:
    """A table, with a heading above the rows of each cell."""
    heads = [head.replace("\n", " ") for head in table.heads]
    html = []
    for cell, rows in groupby(table.rows, lambda row: row.cell):
        if cell != ():
            place = "all cells, seed by seed" if cell is None else cell_text(cell)
            html.append(f'<tr><th colspan="{len(heads)}">{escape(place)}</th></tr>')
        for row in rows:
            first, *rest = map(escape, row.texts)
            entries = "".join(f"<td>{text}</td>" for text in rest)
            html.append(f'<tr><td class="name">{first}</td>{entries}</tr>')
    return make_table_element(heads, html)


def make_table_element(heads: Sequence[str], rows: Sequence[str], kind: str = "") -> str:
    """The HTML element of a table from its headings and its rows of HTML."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "\n".join(_label_cells(row, heads) for row in rows)
    text = f'<table class="{kind}"><thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table>'
    return f'<div class="wide">{text}</div>'


def _label_cells(row: str, heads: Sequence[str]) -> str:
    """A row whose cells contain their headings, for narrow screens; cells that span columns have none."""
    names = iter(heads)
    return re.sub(r"<td\b(?! colspan)", lambda _: f'<td data-head="{escape(next(names))}"', row)
