"""Tables of results and run times on the report's page, and the verdict on a planner in one sentence."""

import math
from collections.abc import Sequence
from html import escape
from itertools import groupby

from sim.analysis.answers import Answer
from sim.analysis.cell_text import Cell, cell_text
from sim.analysis.differences import Difference
from sim.evaluation.metric import Metric
from sim.report.page_elements import table
from sim.report.tables import Layout, tables, texts_of


def result_tables(found: Sequence[Answer], baseline: str) -> str:
    """The tables of each metric."""
    return "\n".join(_table(layout, lines) for layout, lines in tables(found, baseline))


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
