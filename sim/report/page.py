"""`report.html`: a study on one page that needs nothing else, written for people who did not run it."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from itertools import groupby
from string import Template

from sim.analysis.answers import Answer, Difference
from sim.analysis.cell_text import Cell, cell_text
from sim.analysis.cells import Group
from sim.evaluation.metric import Metric
from sim.report.pictures import Picture
from sim.report.replay_commands import anchor, command, extremes
from sim.report.tables import Layout, layouts, texts_of
from sim.scenario.random_streams import numbered
from sim.study.row import Row

_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<link rel="icon" href="data:,">
<title>$title</title>
<style>
$style
</style>
</head>
<body>
<main>
$body
</main>
</body>
</html>
""")

_STYLE = """:root { color-scheme: light;
  --ink: #282624; --soft: #66615a; --line: #ded8cc; --paper: #f8f5ed; --link: #005a8c; }
* { box-sizing: border-box; }
body { margin: 0; background: #fff; color: var(--ink); font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 28px 32px 80px; }
h1 { font-size: 28px; line-height: 1.2; margin: 0 0 6px; }
h2 { font-size: 21px; margin: 44px 0 10px; padding-top: 14px; border-top: 1px solid var(--line); }
h3 { font-size: 17px; margin: 26px 0 8px; }
p, ul { margin: 8px 0; max-width: 85ch; }
a { color: var(--link); }
nav { margin: 14px 0 0; display: flex; flex-wrap: wrap; gap: 4px 18px; }
.soft { color: var(--soft); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 14.5px; font-variant-numeric: tabular-nums; }
th, td { padding: 4px 14px 4px 0; text-align: right; vertical-align: baseline; white-space: nowrap; }
th:first-child, td:first-child, .left td, .left th { text-align: left; }
td.text { white-space: normal; overflow-wrap: anywhere; text-align: left; }
thead th { border-bottom: 2px solid var(--ink); font-weight: 600; }
tbody th { padding-top: 12px; font-weight: 600; text-align: left; }
tbody tr { border-bottom: 1px solid var(--line); }
.name { white-space: normal; overflow-wrap: anywhere; min-width: 14ch; max-width: 46ch; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 3px 22px; margin: 8px 0; }
dt { color: var(--soft); } dd { margin: 0; overflow-wrap: anywhere; }
figure { margin: 14px 0 26px; } figure img { max-width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: 14.5px; max-width: 95ch; margin-top: 6px; }
code { font: 13.5px/1.45 ui-monospace, "DejaVu Sans Mono", monospace; }
code.command { display: block; background: var(--paper); border: 1px solid var(--line); border-radius: 4px;
  padding: 6px 10px; margin: 3px 0; user-select: all; white-space: pre-wrap; overflow-wrap: anywhere; }
.map { margin: 12px 0; scroll-margin-top: 16px; } .map:target { outline: 3px solid #e69f00; outline-offset: 5px; }
.failed { border-left: 4px solid #c8102e; padding-left: 12px; }
@media (max-width: 700px) {  /* a phone: each line of a table is a card, its headings beside the values */
  main { padding: 16px 16px 60px; overflow-wrap: anywhere; }
  dl { grid-template-columns: minmax(0, 1fr); } dd { margin-bottom: 6px; }
  .wide thead { display: none; }
  .wide table, .wide tbody, .wide tr, .wide th { display: block; }
  .wide td { display: flex; justify-content: space-between; gap: 14px; padding-right: 0; white-space: normal; }
  .wide td:empty { display: none; }
  .wide td::before { content: attr(data-head); color: var(--soft); text-align: left; }
  .wide td.name { max-width: none; font-weight: 600; } .wide td.name::before { content: none; }
}"""


def page(title: str, sections: Sequence[tuple[str, str]]) -> str:
    """The page from its sections: heading and HTML of each; the first comes without a heading, before the contents."""
    (_, opening), *rest = sections
    names = [f"section-{i}" for i in range(1, len(rest) + 1)]
    links = "\n".join(f'<a href="#{n}">{escape(h)}</a>' for n, (h, _) in zip(names, rest, strict=True))
    parts = [f'<h2 id="{n}">{escape(h)}</h2>\n{text}' for n, (h, text) in zip(names, rest, strict=True)]
    body = "\n".join([opening, f"<nav>\n{links}\n</nav>", *parts])
    return _PAGE.substitute(title=escape(title), style=_STYLE, body=body)


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Names and values; those without a value are left out."""
    lines = [f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in pairs if value]
    return "<dl>\n" + "\n".join(lines) + "\n</dl>"


def listed(lines: Iterable[str]) -> str:
    """Plain lines as a list."""
    return "<ul>\n" + "\n".join(f"<li>{escape(line)}</li>" for line in lines) + "\n</ul>"


def paragraph(text: str, kind: str = "") -> str:
    """A plain text."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def commanded(text: str) -> str:
    """A command line, which one click selects whole."""
    return f'<code class="command">{escape(text)}</code>'


def result_tables(found: Sequence[Answer], baseline: str) -> str:
    """The tables of each metric."""
    parts = []
    for _, group in groupby(found, lambda answer: answer.metric):
        lines = list(group)
        parts += [_table(layout, lines) for layout in layouts(lines, baseline)]
    return "\n".join(parts)


def _table(layout: Layout, found: Sequence[Answer]) -> str:
    rows = []
    for cell, lines in groupby(found, lambda answer: answer.cell):
        if cell != ():
            rows.append(f'<tr><th colspan="{len(layout.heads)}">{escape(_place(cell))}</th></tr>')
        for answer in lines:
            first, *rest = layout.texts(answer)
            cells = "".join(f"<td>{escape(text)}</td>" for text in rest)
            rows.append(f'<tr><td class="name">{escape(first)}</td>{cells}</tr>')
    aim = _aim(found[0].metric) if layout.first else ""
    return f"<h3>{escape(layout.title)}{aim}</h3>\n{_tabled(layout.heads, rows)}"


def runtime_tables(found: Sequence[Answer]) -> str:
    """A line for each cell and a column for each planner, as in the table of [Li22]."""
    own = [answer for answer in found if answer.cell is not None]
    planners = list(dict.fromkeys(answer.planner for answer in own))
    return "\n".join(_pivot(metric, list(lines), planners) for metric, lines in groupby(own, lambda a: a.metric))


def _pivot(metric: Metric, found: Sequence[Answer], planners: Sequence[str]) -> str:
    rows = []
    for cell, lines in groupby(found, lambda answer: answer.cell):
        means = {answer.planner: texts_of(answer, compared=False)[2] for answer in lines}
        cells = "".join(f"<td>{escape(means.get(planner, ''))}</td>" for planner in planners)
        rows.append(f"<tr><td>{escape(_place(cell)) or 'all missions'}</td>{cells}</tr>")
    return f"<h3>{escape(metric.title)}{_aim(metric)}</h3>\n{_tabled(['cell', *planners], rows)}"


def _aim(metric: Metric) -> str:
    aim = "" if metric.better == "neither" else f": {metric.better} is better"
    return f'<span class="soft">{aim}</span>'


def _tabled(heads: Sequence[str], rows: Sequence[str], kind: str = "") -> str:
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "\n".join(_labelled(row, heads) for row in rows)
    table = f'<table class="{kind}"><thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table>'
    return f'<div class="wide">{table}</div>'


def _labelled(row: str, heads: Sequence[str]) -> str:
    """A row whose cells know their headings, for screens too narrow for columns."""
    names = iter(heads)
    return re.sub(r"<td\b", lambda _: f'<td data-head="{escape(next(names))}"', row)


def _place(cell: Cell | None) -> str:
    return "all cells, seed by seed" if cell is None else cell_text(cell)


def verdict(planner: str, baseline: str, metric: Metric, gap: Difference, *, shown: int = 1) -> str:
    """One sentence that says whether a planner can be told from the baseline, and how.

    shown: how many differences the page shows, of which this is one.
    """
    if not gap.pairs:
        return f"{planner} and {baseline} cannot be told apart: they have no map in common."
    unit = " points" if metric.unit == "%" else f" {metric.unit}".rstrip()
    mean, low, high = (metric.text(v, signed=True) for v in (gap.mean.value, gap.mean.low, gap.mean.high))
    over = f", mean over {gap.cells} cells" if gap.cells > 1 else ""
    within = f" (95 %: {low} to {high}{over})" if gap.pairs > 1 else over
    counted = f"; of {gap.pairs} map{'s' * (gap.pairs > 1)} it won {gap.won}, tied {gap.tied} and lost {gap.lost}"
    ending = counted if metric.better != "neither" else ""
    apart = f"{planner} {_told(metric, gap)} {baseline}"
    start = apart if gap.told else f"{planner} and {baseline} cannot be told apart"
    return f"{start}: {metric.label} {mean}{unit}{within}{ending}. {_remark(gap, shown)}".strip()


def _remark(gap: Difference, shown: int) -> str:
    """Remark that a reader of a verdict needs."""
    if gap.told:
        lone = gap.survives or shown == 1
        return "" if lone else f"This does not survive Holm's correction for all {shown} differences."
    few = f"{gap.pairs} map{'s' * (gap.pairs > 1)} cannot tell any planners apart, six at least are needed. "
    needed = f"A difference as large takes some {gap.needed:.0f} maps." if math.isfinite(gap.needed) else ""
    return (few if gap.pairs < 6 else "") + needed


def _told(metric: Metric, gap: Difference) -> str:
    above = gap.mean.value > 0
    if metric.better == "neither":
        return "is above" if above else "is below"
    return "is better than" if above == (metric.better == "higher") else "is worse than"


def figures(pictures: Sequence[Picture]) -> str:
    """Pictures inside the page, as SVG unless that is far larger."""
    return "\n".join(_figure(picture) for picture in pictures)


def _figure(picture: Picture) -> str:
    kind, data = ("svg+xml", picture.svg) if len(picture.svg) < 3 * len(picture.png) else ("png", picture.png)
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
    image = f'<img src="{source}" alt="{escape(picture.alt)}">'
    caption = f"<figcaption>{escape(picture.caption)}</figcaption>"
    return f"<h3>{escape(picture.title)}</h3>\n<figure>\n{image}\n{caption}\n</figure>"


def maps(groups: Sequence[Group], metric: Metric) -> tuple[str, str]:
    """Best and worst maps with links, and what these lead to: the commands."""
    rows, places = [], []
    for number, extreme in enumerate(extremes(groups, metric), start=1):
        group, cells = extreme.group, []
        for k, (what, row) in enumerate((("best", extreme.best), ("worst", extreme.worst))):
            name, value = anchor(row, 2 * number + k), metric.text(row.metrics[metric.name])
            cells.append(f'<td>{escape(value)}</td><td><a href="#{name}">{numbered(row.seed, row.repeat)}</a></td>')
            shown = f"{value} {metric.unit}".rstrip()
            label = ", ".join(filter(None, [cell_text(group.cell), row.planner, numbered(row.seed, row.repeat)]))
            text = f"{label}: {what}, {shown}"
            places.append(f'<div class="map" id="{name}">{escape(text)}{commanded(command(row))}</div>')
        first = f'<td>{escape(cell_text(group.cell))}</td><td class="name">{escape(group.planner)}</td>'
        rows.append(f"<tr>{first}{''.join(cells)}</tr>")
    heads = ["cell", "planner", f"best [{metric.unit}]" if metric.unit else "best", "map", "worst", "map"]
    return _tabled(heads, rows, "left"), "\n".join(places)


def failures(rows: Sequence[Row]) -> str:
    """Every trial that failed, with its error and command."""
    parts = []
    for number, row in enumerate(rows, start=1):
        label = ", ".join(filter(None, [cell_text(row.factors), row.planner, numbered(row.seed, row.repeat)]))
        parts.append(
            f'<div class="map failed" id="failure-{number}">{escape(label)}: <strong>{escape(row.error or "no error")}'
            f"</strong>{commanded(command(row))}</div>"
        )
    return "\n".join(parts)
