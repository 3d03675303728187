"""The answers of a study as tables: in the terminal, as CSV and as Markdown."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from itertools import groupby

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sim.console import console as terminal
from sim.study.answers import Answer, Difference, answers
from sim.study.cells import Cell, baseline_of, cell_text, constant, grouped, trimmed
from sim.study.measures import UNKNOWN, Measure, chosen
from sim.study.row import Row
from sim.study.statistics import NO_ESTIMATE, Estimate

WIDE = 100  # columns from which on the terminal has room for medians
NOTE = (
    "In brackets: 95 % bootstrap intervals over the maps. Differences are means over the maps (seeds) that both flew; "
    "won, tied, lost counts these maps."
)


def show(
    rows: Sequence[Row], baseline: str | None = None, metrics: Sequence[str] = (), *, on: Console = terminal
) -> None:
    """Print the answers; InputError where a metric or the baseline is unknown.

    baseline: a planner as given, by name or by label; the first row's if None. metrics: flat names; the usual if none.
    """
    first = baseline_of(rows, baseline)
    groups = grouped(rows, first)
    found = answers(trimmed(groups), chosen(rows, metrics), first)
    if constant(groups):
        on.print(f"Everywhere: {escape(cell_text(constant(groups)))}")
    for measure, lines in groupby(found, lambda answer: answer.measure):
        on.print(_terminal_table(measure, list(lines), first, on.width >= WIDE))
    on.print(NOTE, style="dim")
    for line in shortfalls(found):
        on.print(escape(line), style="bold red")


def shortfalls(found: Sequence[Answer]) -> list[str]:
    """What the numbers leave out, one line each: trials that failed, values that are undefined, maps without a pair."""
    lines: dict[str, None] = {}
    for answer in found:
        who = f"{answer.planner} ({_heading(answer.cell)})" if answer.cell != () else answer.planner
        if answer.failed:
            lines[f"{who}: {answer.failed} of {answer.maps + answer.failed} trials failed and do not count"] = None
        if answer.undefined:
            what = f"{answer.measure.label} is undefined on {answer.undefined} of {answer.maps} maps"
            lines[f"{who}: {what}"] = None
        gaps = answer.difference
        if gaps and gaps.unpaired:
            what = "in every cell a pair" if answer.cell is None else "a pair"
            lines[f"{who}: {gaps.pairs} of {gaps.pairs + gaps.unpaired} maps have {what} with the baseline's"] = None
    return list(lines)


def columns(baseline: str, *, compared: bool) -> list[str]:
    """Headings of the table of one metric."""
    return ["planner", "maps", "mean", "median", *([f"less {baseline}", "won, tied, lost"] if compared else [])]


def texts_of(answer: Answer, *, compared: bool) -> list[str]:
    """What stands under the headings."""
    measure = answer.measure
    own = [maps(answer), *(_estimate(measure, e) for e in (answer.mean, answer.median))]
    if answer.cell is None:
        own = [f"{answer.difference.cells} cells" if answer.difference else "", "", ""]
    return [answer.planner, *own, *(_compared(measure, answer.difference) if compared else [])]


def maps(answer: Answer) -> str:
    """How many maps count, and of how many if not all do."""
    counted, flown = answer.maps - answer.undefined, answer.maps + answer.failed
    return str(counted) if counted == flown else f"{counted}/{flown}"


def _estimate(measure: Measure, estimate: Estimate, *, signed: bool = False) -> str:
    inside = measure.within(estimate.low, estimate.high, signed=signed)
    return f"{measure.text(estimate.value, signed=signed)} {inside}".strip()


def _compared(measure: Measure, difference: Difference | None) -> list[str]:
    if difference is None:
        return ["baseline", ""]
    return [_estimate(measure, difference.mean, signed=True), record(measure, difference)]


def record(measure: Measure, difference: Difference) -> str:
    """Maps won, tied and lost; a dash where neither way is better or nothing is paired."""
    if measure.better == "neither" or not difference.pairs:
        return UNKNOWN
    return f"{difference.won}, {difference.tied}, {difference.lost}"


def _terminal_table(measure: Measure, found: Sequence[Answer], baseline: str, wide: bool) -> Table:
    compared = any(answer.difference for answer in found)
    heads = columns(baseline, compared=compared)
    kept = [i for i, name in enumerate(heads) if wide or name != "median"]
    table = Table(
        title=escape(measure.title), title_justify="left", title_style="bold", box=SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    for i in kept:
        table.add_column(
            escape(heads[i]).replace("tied, ", "tied,\n"), justify="left" if i == 0 else "right", overflow="fold"
        )
    for cell, lines in groupby(found, lambda answer: answer.cell):
        table.add_section()
        if cell != ():
            table.add_row(f"[bold]{escape(_heading(cell))}[/bold]")
        for answer in lines:
            texts = texts_of(answer, compared=compared)
            table.add_row(*(escape(texts[i]) for i in kept))
    return table


def _heading(cell: Cell | None) -> str:
    return "all cells" if cell is None else cell_text(cell)


def markdown(found: Sequence[Answer], baseline: str) -> str:
    """One table per metric."""
    parts = []
    for measure, group in groupby(found, lambda answer: answer.measure):
        lines = list(group)
        compared = any(answer.difference for answer in lines)
        names = list(dict.fromkeys(name for answer in lines for name, _ in answer.cell or ()))
        head = [*names, *columns(baseline, compared=compared)]
        rows = [[*_levels(answer.cell, names), *texts_of(answer, compared=compared)] for answer in lines]
        rule = ["---"] * (len(names) + 1) + ["---:"] * (len(head) - len(names) - 1)
        parts.append("\n".join([f"**{measure.title}**", "", *(_markdown_line(line) for line in (head, rule, *rows))]))
    left_out = "\n".join(f"- {_plain(line)}" for line in shortfalls(found))
    return "\n\n".join([*parts, NOTE, *([left_out] if left_out else [])]) + "\n"


def _levels(cell: Cell | None, names: Sequence[str]) -> list[str]:
    return [dict(cell).get(name, "") if cell is not None else "all" for name in names]


def _plain(text: str) -> str:
    return text.replace("\\", "\\\\").replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")


def _markdown_line(texts: Sequence[str]) -> str:
    return f"| {' | '.join(_plain(text) for text in texts)} |"


def comma_separated(found: Sequence[Answer], baseline: str) -> str:
    """One line per cell, planner and metric, values in SI units; empty where undefined."""
    names = list(dict.fromkeys(name for answer in found for name, _ in answer.cell or ()))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*names, *_CSV])
    for answer in found:
        own = [answer.planner, answer.measure.name, answer.maps, answer.failed, answer.undefined]
        difference = answer.difference
        counts = (
            [""] * 6
            if difference is None
            else [baseline, difference.pairs, difference.unpaired, difference.won, difference.tied, difference.lost]
        )
        estimates = (answer.mean, answer.median, difference.mean if difference else NO_ESTIMATE)
        numbers = [_number(value) for e in estimates for value in (e.value, e.low, e.high)]
        writer.writerow([*_levels(answer.cell, names), *own, *numbers, *counts])
    return text.getvalue()


_CSV = (
    *("planner", "metric", "maps", "failed", "undefined"),
    *(f"{name}{part}" for name in ("mean", "median", "difference") for part in ("", "_low", "_high")),
    *("baseline", "pairs", "unpaired", "won", "tied", "lost"),
)


def _number(value: float) -> str:
    return "" if math.isnan(value) else repr(value)
