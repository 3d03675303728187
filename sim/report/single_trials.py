"""Single trials on the report's page: best and worst maps, those that failed, and the commands that fly them again."""

import math
import shlex
from collections.abc import Sequence
from html import escape

from sim.analysis.cell_text import Cell, cell_text, slug
from sim.analysis.cells import Group
from sim.analysis.planner_labels import entrant
from sim.evaluation.metric import Metric
from sim.report.page import commanded, table
from sim.scenario.random_streams import numbered
from sim.study.tasks import Row


def command(row: Row) -> str:
    """The command line that flies a trial again, for a POSIX shell."""
    words = ["understory", "run", row.scenario, "--planner", row.planner, "--seed", str(row.seed)]
    if row.repeat:
        words += ["--repeat", str(row.repeat)]
    for key, value in row.settings.items():
        words += ["--set", f"{key}={value}"]
    return shlex.join(words)


def maps(groups: Sequence[Group], metric: Metric) -> tuple[str, str]:
    """Best and worst maps with links, and what these lead to: the commands; none of a group without a finite value.

    Where neither way is better, they are those of the least and the greatest value.
    """
    names = ("least", "greatest") if metric.better == "neither" else ("best", "worst")
    several = any(group.cell for group in groups)  # else a column of cells would be empty
    rows, places = [], []
    for number, (group, *ends) in enumerate(_extremes(groups, metric), start=1):
        cells = []
        for k, (what, row) in enumerate(zip(names, ends, strict=True)):
            value, flown = metric.text(row.metrics[metric.name]), numbered(row.seed, row.repeat)
            name = f"map-{2 * number + k}-{slug(f'{entrant(row)} {flown}')}"
            cells.append(f'<td>{escape(value)}</td><td><a href="#{name}">{flown}</a></td>')
            text = f"{_label(group.cell, row)}: {what}, {value} {metric.unit}".rstrip()
            places.append(f'<div class="map" id="{name}">{escape(text)}{commanded(command(row))}</div>')
        cell = f"<td>{escape(cell_text(group.cell))}</td>" * several
        rows.append(f'<tr>{cell}<td class="name">{escape(group.planner)}</td>{"".join(cells)}</tr>')
    unit = f" [{metric.unit}]" if metric.unit else ""
    heads = ["cell"] * several + ["planner"]
    for name in names:
        heads += [f"{name}{unit}", "map"]
    return table(heads, rows, "left"), "\n".join(places)


def _extremes(groups: Sequence[Group], metric: Metric) -> list[tuple[Group, Row, Row]]:
    """Each group with a finite value, its best and its worst trial."""
    found = []
    for group in groups:
        rows = [row for row in group.done if math.isfinite(row.metrics.get(metric.name, math.nan))]
        if rows:
            rows.sort(
                key=lambda row: (row.metrics[metric.name], row.seed, row.repeat), reverse=metric.better == "higher"
            )
            found.append((group, rows[0], rows[-1]))
    return found


def failures(groups: Sequence[Group]) -> str:
    """Every trial that failed, with its error and command."""
    failed = [(group.cell, row) for group in groups for row in group.failed]
    return "\n".join(
        f'<div class="map failed" id="failure-{number}">{escape(_label(cell, row))}: '
        f"<strong>{escape(row.error or 'no error')}</strong>{commanded(command(row))}</div>"
        for number, (cell, row) in enumerate(failed, start=1)
    )


def _label(cell: Cell, row: Row) -> str:
    return ", ".join(filter(None, [cell_text(cell), entrant(row), numbered(row.seed, row.repeat)]))
