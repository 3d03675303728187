"""A study's results as one wide table, with the levels of a factor or the planners side by side.

`python -m sim.report.wide_table DIR` prints it as Markdown; docs/results/paper.md has examples.
"""

from collections import defaultdict
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
from sim.report.formats import escape_markdown, format_markdown_table
from sim.study.store import read_rows
from sim.study.tasks import Row
from sim.terminal.commands import run_alone
from tracking.errors import InputError, check_known

_SHARE = "ospa.share_under_1m"


def set_side_by_side(
    rows: Sequence[Row], columns: str, less: str = "left", metric: str = _SHARE, baseline: str | None = None
) -> str:
    """Table in Markdown: a row for each cell, and a column for each level of the factor `columns`, or each planner.

    Each mean is followed by its paired difference from the first column (less="left") or from the previous row of the
    column, if only the last factor differs (less="above"); without such a pair, by its interval. The baseline, by
    default the first planner by alphabet, comes first.
    """
    groups = drop_constant_factors(group_rows(rows, baseline_of(rows, baseline)))
    (known,) = choose_metrics(rows, [metric])
    by = {**varying_factors(groups), "planner": list(dict.fromkeys(group.planner for group in groups))}
    check_known("--columns", columns, by)
    down = [name for name in by if name != columns and len(by[name]) > 1]
    found: dict[tuple[str, ...], dict[str, Group]] = {}  # by the beginning of the row, then by column
    for group in groups:
        levels = defaultdict(lambda: "-", group.cell, planner=group.planner)  # a dash for a factor that it lacks
        found.setdefault(tuple(levels[name] for name in down), {})[levels[columns]] = group
    across = list(dict.fromkeys([*by[columns], *(level for own in found.values() for level in own)]))
    symbol = "" if columns == "planner" else f"{SYMBOLS.get(columns, columns)} = "
    heads = [*(SYMBOLS.get(name, name) for name in down), *(f"{symbol}{level}" for level in across)]
    texts = []
    above: tuple[str, ...] = ()
    for start, own in found.items():
        left = dict.fromkeys(across, own.get(across[0]))
        bases = left if less == "left" else found[above] if above and above[:-1] == start[:-1] else {}
        texts.append([*start, *(_entry(own.get(level), bases.get(level), known) for level in across)])
        above = start
    return format_markdown_table(map(escape_markdown, heads), [map(escape_markdown, row) for row in texts])


def drop_start(rows: Sequence[Row], first: int) -> list[Row]:
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


def _entry(group: Group | None, base: Group | None, metric: Metric) -> str:
    if group is None:
        return "-"
    mean = map_means(group, metric)
    if base is None or base is group:
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
    print(set_side_by_side(drop_start(read_rows(folder), first), columns, less, metric, baseline))


if __name__ == "__main__":
    run_alone(main)
