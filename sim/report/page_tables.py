"""Tables of results and run times on the report's page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import groupby

from sim.analysis.answers import Answer
from sim.analysis.cell_text import Cell, cell_text
from sim.evaluation.metric import Metric
from sim.report.page_elements import table
from sim.report.tables import Layout, layouts, texts_of


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
    return f"<h3>{escape(layout.title)}{aim}</h3>\n{table(layout.heads, rows)}"


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
    return f"<h3>{escape(metric.title)}{_aim(metric)}</h3>\n{table(['cell', *planners], rows)}"


def _aim(metric: Metric) -> str:
    aim = "" if metric.better == "neither" else f": {metric.better} is better"
    return f'<span class="soft">{aim}</span>'


def _place(cell: Cell | None) -> str:
    return "all cells, seed by seed" if cell is None else cell_text(cell)
