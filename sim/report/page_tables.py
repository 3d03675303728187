"""Tables of results and run times on the report's page, and verdicts on planners in one sentence."""

import math
from collections.abc import Iterable, Sequence
from html import escape
from itertools import groupby

from sim.analysis.answers import Answer
from sim.analysis.cell_text import cell_text
from sim.analysis.differences import Difference
from sim.evaluation.metric import Metric
from sim.report.html_parts import table
from sim.report.tables import Line, Table


def html_table(shown: Table) -> str:
    """A table as HTML, with a heading line above the lines of each cell."""
    rows = []
    for cell, lines in groupby(shown.lines, lambda line: line.cell):
        if cell != ():
            place = "all cells, seed by seed" if cell is None else cell_text(cell)
            rows.append(f'<tr><th colspan="{len(shown.heads)}">{escape(place)}</th></tr>')
        for line in lines:
            first, *rest = line.texts
            entries = "".join(f"<td>{escape(text)}</td>" for text in rest)
            rows.append(f'<tr><td class="name">{escape(first)}</td>{entries}</tr>')
    return table(shown.heads, rows)


def runtime_tables(found: Sequence[Answer]) -> str:
    """Tables with a line for each cell and a column for each planner, as in [Li22]."""
    own = [answer for answer in found if answer.cell is not None]
    planners = list(dict.fromkeys(answer.planner for answer in own))
    made = []
    for metric, of_metric in groupby(own, lambda answer: answer.metric):
        lines = []
        for cell, of_cell in groupby(of_metric, lambda answer: answer.cell):
            means = {answer.planner: answer.mean.text(metric) for answer in of_cell}
            texts = [cell_text(cell) or "all missions", *(means.get(planner, "") for planner in planners)]
            lines.append(Line((), texts))
        made.append(Table(metric.title, ["cell", *planners], lines, metric))
    return titled_tables(made)


def titled_tables(tables: Iterable[Table]) -> str:
    """Tables as HTML under their titles, which say which direction of the metric is better."""
    parts = []
    for shown in tables:
        better = shown.metric.better if shown.metric else "neither"
        aim = f'<span class="soft">: {better} is better</span>' if better != "neither" else ""
        parts.append(f"<h3>{escape(shown.title)}{aim}</h3>\n{html_table(shown)}")
    return "\n".join(parts)


def verdict(planner: str, baseline: str, metric: Metric, gap: Difference, *, shown: int = 1) -> str:
    """One sentence that says whether a planner is better or worse than the baseline, or cannot be told apart.

    shown: number of differences that the page shows, including this one.
    """
    if not gap.pairs:
        return f"{planner} and {baseline} cannot be told apart: they have no map in common."
    unit = " points" if metric.unit == "%" else f" {metric.unit}".rstrip()
    mean, low, high = (metric.text(v, signed=True) for v in (gap.mean.value, gap.mean.low, gap.mean.high))
    over = f", mean over {gap.cells} cells" if gap.cells > 1 else ""
    within = f" (95 %: {low} to {high}{over})" if gap.pairs > 1 else over
    counted = f"; of {gap.pairs} map{'s' * (gap.pairs > 1)} it won {gap.won}, tied {gap.tied} and lost {gap.lost}"
    ending = counted if metric.better != "neither" else ""
    apart = f"{planner} {_direction(metric, gap)} {baseline}"
    alike = ", being equal on every map" if gap.tied == gap.pairs else ""
    start = apart if gap.significant else f"{planner} and {baseline} cannot be told apart{alike}"
    return f"{start}: {metric.label} {mean}{unit}{within}{ending}. {_remark(gap, shown)}".strip()


def _remark(gap: Difference, shown: int) -> str:
    if gap.significant:
        lone = gap.survives or shown == 1
        return "" if lone else f"This does not survive Holm's correction for all {shown} differences."
    few = f"{gap.pairs} map{'s' * (gap.pairs > 1)} cannot tell any planners apart; at least six are needed. "
    needed = f"To find a difference of this size takes about {gap.needed:.0f} maps."
    return (few if gap.pairs < 6 else "") + (needed if math.isfinite(gap.needed) else "")


def _direction(metric: Metric, gap: Difference) -> str:
    above = gap.mean.value > 0
    if metric.better == "neither":
        return "is above" if above else "is below"
    return "is better than" if above == (metric.better == "higher") else "is worse than"
