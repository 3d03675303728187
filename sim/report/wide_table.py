"""A study's results as one wide table, with the levels of a factor or the planners side by side.

`python -m sim.report.wide_table DIR` prints it as Markdown; docs/results/paper.md has examples.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from sim.analysis.answers import map_means
from sim.analysis.cell_text import SYMBOLS
from sim.analysis.differences import differences, pair_differences
from sim.analysis.distributions import share_under
from sim.analysis.groups import Group, drop_constant_factors, group_rows, varying_factors
from sim.analysis.metric_choice import choose_metrics
from sim.analysis.planner_labels import baseline_of
from sim.evaluation.metric import Metric
from sim.report.formats import escape_markdown, markdown_table
from sim.study.store import read_rows
from sim.study.tasks import Row
from sim.terminal.commands import run_alone
from tracking.errors import InputError, check_known

_SHARE = "ospa.share_under_1m"


def table(
    rows: Sequence[Row], columns: str, less: str = "left", metric: str = _SHARE, baseline: str | None = None
) -> str:
    """Table in Markdown: a line for each cell, and a column for each level of the factor `columns`, or each planner.

    Each mean is followed by its paired difference from the first column (less="left") or from the previous line of the
    column, if only the last factor differs (less="above"); without such a pair, by its interval. The baseline, by
    default the first planner by alphabet, comes first.
    """
    groups = drop_constant_factors(group_rows(rows, baseline_of(rows, baseline)))
    (known,) = choose_metrics(rows, [metric])
    by = {**varying_factors(groups), "planner": list(dict.fromkeys(group.planner for group in groups))}
    check_known("--columns", columns, by)
    down = [name for name in by if name != columns and len(by[name]) > 1]
    places = {_place(group, columns, down): group for group in groups}
    lines = list(dict.fromkeys(line for line, _ in places))
    levels = list(dict.fromkeys([*by[columns], *(level for _, level in places)]))
    symbol = "" if columns == "planner" else f"{SYMBOLS.get(columns, columns)} = "
    head = [*(SYMBOLS.get(name, name) for name in down), *(f"{symbol}{level}" for level in levels)]
    texts = []
    for before, line in zip([(), *lines], lines, strict=False):
        entries = []
        for level in levels:
            related = before[:-1] == line[:-1] and len(before) == len(line)
            base = {"left": (line, levels[0]), "above": (before, level) if related else None}[less]
            group = places.get((line, level))
            other = places.get(base) if base else None
            entries.append(_entry(group, None if other is group else other, known))
        texts.append(map(escape_markdown, [*line, *entries]))
    return markdown_table(map(escape_markdown, head), texts)


def without_start(rows: Sequence[Row], first: int) -> list[Row]:
    """The rows with the share of scans with OSPA under 1 m counted from scan `first` on.

    Note: it counts scans by the mean over UAVs, because stores do not have the OSPA of single UAVs.
    """
    if first == 0:
        return list(rows)
    return [
        msgspec.structs.replace(row, metrics={**row.metrics, _SHARE: share_under(row.ospa[first:].astype(float), 1.0)})
        if row.status == "done"
        else row
        for row in rows
    ]


def _place(group: Group, columns: str, down: Sequence[str]) -> tuple[tuple[str, ...], str]:
    """Place of a group: the beginning of its line, and its column; a dash for a factor that it lacks."""
    found = {"planner": group.planner, **dict(group.cell)}
    return tuple(found.get(name, "-") for name in down), found.get(columns, "-")


def _entry(group: Group | None, base: Group | None, metric: Metric) -> str:
    if group is None:
        return "-"
    mean = map_means(group, metric)
    if base is None:
        return mean.text(metric)
    (difference,) = differences(pair_differences(group, base, [metric]), [metric])
    return f"{metric.text(mean.value)}: {difference.mean.text(metric, signed=True)}"


def main(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a study.")],
    columns: Annotated[str, typer.Option(metavar="NAME", help="Stands side by side: planner or a factor.")] = "planner",
    less: Annotated[str, typer.Option(metavar="WHICH", help="Differences to: left or above.")] = "left",
    first: Annotated[
        int,
        typer.Option(
            "--from-scan",
            metavar="N",
            min=0,
            help="Count OSPA under 1 m, the mean over UAVs, from this scan on; the paper's: 10.",
        ),
    ] = 0,
    baseline: Annotated[str | None, typer.Option(metavar="NAME", help="The planner that comes first.")] = None,
    metric: Annotated[str, typer.Option(metavar="NAME", help="See docs/how-to/studies.md.")] = _SHARE,
) -> None:
    """Print a study's results as one wide table in Markdown."""
    check_known("--less", less, ("left", "above"))
    if first and metric != _SHARE:
        raise InputError(f"--from-scan: counts {_SHARE} alone, not {metric}; leave one of both out")
    print(table(without_start(read_rows(folder), first), columns, less, metric, baseline))


if __name__ == "__main__":
    run_alone(main)
