"""The answers of a study as Markdown and as CSV."""

import csv
import io
import math
from collections.abc import Sequence
from itertools import groupby

from sim.analysis.answers import Answer
from sim.analysis.cell_text import Cell
from sim.analysis.differences import Difference
from sim.analysis.distributions import NO_SPREAD
from sim.analysis.intervals import NO_ESTIMATE
from sim.report.tables import Layout, layouts, notes, shortfalls


def markdown(found: Sequence[Answer], baseline: str) -> str:
    """One table per metric."""
    parts = []
    for _, group in groupby(found, lambda answer: answer.metric):
        lines = list(group)
        parts += [_markdown_table(layout, lines) for layout in layouts(lines, baseline)]
    said = "\n".join(f"- {_plain(line)}" for line in (*notes(found), *shortfalls(found)))
    return "\n\n".join([*parts, said]) + "\n"


def _markdown_table(layout: Layout, found: Sequence[Answer]) -> str:
    names = list(dict.fromkeys(name for answer in found for name, _ in answer.cell or ()))
    head = [*names, *layout.heads]
    rows = [[*_levels(answer.cell, names), *layout.texts(answer)] for answer in found]
    rule = ["---"] * (len(names) + 1) + ["---:"] * (len(head) - len(names) - 1)
    return "\n".join([f"**{layout.title}**", "", *(_markdown_line(line) for line in (head, rule, *rows))])


def _levels(cell: Cell | None, names: Sequence[str]) -> list[str]:
    return [dict(cell).get(name, "") if cell is not None else "all" for name in names]


def _plain(text: str) -> str:
    return text.replace("\\", "\\\\").replace("*", "\\*").replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")


def _markdown_line(texts: Sequence[str]) -> str:
    return f"| {' | '.join(_plain(text) for text in texts)} |"


def comma_separated(found: Sequence[Answer], baseline: str) -> str:
    """One line per cell, planner and metric, values in SI units; empty where undefined."""
    names = list(dict.fromkeys(name for answer in found for name, _ in answer.cell or ()))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*names, *_CSV])
    for answer in found:
        own = (answer.maps, answer.flown, answer.trials, answer.failed, answer.undefined)
        gap = answer.difference
        estimates = (answer.mean, answer.median, gap.mean if gap else NO_ESTIMATE)
        spreads = (answer.spread, gap.spread if gap else NO_SPREAD)
        numbers = [_number(value) for e in estimates for value in (e.value, e.low, e.high)]
        numbers += [_number(value) for s in spreads for value in (s.between, s.within)]
        place = [*_levels(answer.cell, names), answer.planner, answer.metric.name]
        writer.writerow([*place, *own, *numbers, *([""] * 9 if gap is None else _of_pairs(baseline, gap))])
    return text.getvalue()


_CSV = (
    *("planner", "metric", "maps", "flown", "trials", "failed", "undefined"),
    *(f"{name}{part}" for name in ("mean", "median", "difference") for part in ("", "_low", "_high")),
    *("between_maps", "within_maps", "difference_between_maps", "difference_within_maps"),
    *("baseline", "pairs", "unpaired", "won", "tied", "lost", "p", "holm", "maps_needed"),
)


def _of_pairs(baseline: str, gap: Difference) -> list[str | int]:
    """The columns of a difference that are counts, or follow from its values."""
    counts = (gap.pairs, gap.unpaired, gap.won, gap.tied, gap.lost)
    return [baseline, *counts, _number(gap.chance), int(gap.survives), _number(gap.needed)]


def _number(value: float) -> str:
    return "" if math.isnan(value) else repr(value)
