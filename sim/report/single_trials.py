"""Single trials on the report's page: best and worst maps, and those that failed."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from sim.analysis.cell_text import cell_text
from sim.analysis.cells import Group
from sim.evaluation.metric import Metric
from sim.report.page_elements import commanded, table
from sim.report.replay_commands import anchor, command, extremes
from sim.scenario.random_streams import numbered
from sim.study.row import Row


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
    return table(heads, rows, "left"), "\n".join(places)


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
