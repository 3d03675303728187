"""Single trials on the report's page: best and worst maps, failed trials, and the commands that fly them again."""

import shlex
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from sim.facts.metrics.metric import Metric
from sim.scenario.random_streams import format_seed
from sim.study.analysis.groups import Group
from sim.study.analysis.labels import cell_text, format_entrant, make_slug
from sim.study.cells import Levels
from sim.study.report.html_parts import make_command_line, make_table_element
from sim.study.trials import TrialRow


def format_command(row: TrialRow) -> str:
    """The command line that flies a trial again, for a POSIX shell."""
    words = ["understory", "run", row.scenario, "--planner", row.planner, "--seed", str(row.seed)]
    if row.repeat:
        words += ["--repeat", str(row.repeat)]
    for key, value in row.settings.items():
        words += ["--set", f"{key}={value}"]
    return shlex.join(words)


class _Extreme(NamedTuple):
    """A trial that is shown for its value."""

    name: str  # "best, ", for example, or empty if all trials are equal
    row: TrialRow
    remark: str  # on equal trials


class ExtremeMaps(NamedTuple):
    """HTML of best and worst maps."""

    tables: str
    commands: str  # that fly these maps, to which the tables link; empty if there are none


def show_extreme_maps(groups: Sequence[Group], metric: Metric) -> ExtremeMaps:
    """Tables of best and worst maps and, linked from these, their commands; groups without a finite value are left out.

    If neither direction is better, they are the maps with the least and the greatest value. The first of several equal
    trials represents them; if all are equal, it is neither best nor worst.
    """
    names = ("least", "greatest") if metric.better == "neither" else ("best", "worst")
    several = any(group.cell for group in groups)  # otherwise the column of cells would be empty
    rows: list[str] = []
    places: list[str] = []
    for group in groups:
        cells = []
        ends = _find_extremes(group, metric, names)
        for what, row, remark in ends:
            value = metric.text(row.metrics[metric.name])
            flown = format_seed(row.seed, row.repeat)
            name = f"map-{len(places)}-{make_slug(f'{format_entrant(row)} {flown}')}"
            link = f'<a href="#{name}">{flown}</a>{remark}'
            one = f'<td colspan="4">{escape(value)}, {link}</td>'  # neither best nor worst
            cells.append(f"<td>{escape(value)}</td><td>{link}</td>" if len(ends) > 1 else one)
            text = f"{_label(group.cell, row)}: {what}{value} {metric.unit}".rstrip() + remark
            places.append(f'<div class="map" id="{name}">{escape(text)}{make_command_line(format_command(row))}</div>')
        if cells:
            cell = f"<td>{escape(cell_text(group.cell))}</td>" * several
            rows.append(f'<tr>{cell}<td class="name">{escape(group.planner)}</td>{"".join(cells)}</tr>')
    unit = f" [{metric.unit}]" if metric.unit else ""
    heads = ["cell"] * several + ["planner"]
    for name in names:
        heads += [f"{name}{unit}", "map"]
    return ExtremeMaps(make_table_element(heads, rows, "left"), "\n".join(places))


def _find_extremes(group: Group, metric: Metric, names: Sequence[str]) -> list[_Extreme]:
    """The best and the worst trial; only one if all are equal."""
    values = group.values(metric.name)
    finite = np.flatnonzero(np.isfinite(values))
    ends = np.unique(values[finite])[:: -1 if metric.better == "higher" else 1]
    if not len(ends):
        return []
    if len(ends) == 1:
        remark = f", all {len(finite)} equal" if len(finite) > 1 else ", the only one"
        return [_Extreme("", group.done[finite[0]], remark)]
    found = []
    for name, end in zip(names, ends[[0, -1]], strict=True):
        first, *others = np.flatnonzero(values == end)
        found.append(_Extreme(f"{name}, ", group.done[first], f" and {len(others)} equal" if others else ""))
    return found


def list_failures(groups: Sequence[Group]) -> str:
    """Table of the trials that failed, with error and command."""
    failed = [(group.cell, row) for group in groups for row in group.failed]
    return "\n".join(
        f'<div class="map failed" id="failure-{number}">{escape(_label(cell, row))}: '
        f"<strong>{escape(row.error or 'no error')}</strong>{make_command_line(format_command(row))}</div>"
        for number, (cell, row) in enumerate(failed, start=1)
    )


def _label(cell: Levels, row: TrialRow) -> str:
    return ", ".join(filter(None, [cell_text(cell), format_entrant(row), format_seed(row.seed, row.repeat)]))
