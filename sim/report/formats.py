"""The answers of a study as Markdown and as CSV."""

import csv
import io
import math
from collections.abc import Iterable, Sequence

from sim.analysis.answers import Answer
from sim.analysis.cell_text import Cell
from sim.analysis.distributions import NO_SPREAD
from sim.analysis.intervals import NO_ESTIMATE
from sim.report.tables import Table, notes, shortfalls, tables


def markdown(found: Sequence[Answer], baseline: str, scored: Table | None = None) -> str:
    """Markdown with one table per metric, after the table of scores if there is one."""
    parts = [_table_section(table) for table in ([scored] if scored else []) + tables(found, baseline)]
    said = "\n".join(f"- {escape_markdown(line)}" for line in (*notes(found), *shortfalls(found)))
    return "\n\n".join([*parts, said]) + "\n"


def _table_section(table: Table) -> str:
    names = _factors(line.cell for line in table.lines)
    lines = [map(escape_markdown, [*_levels(line.cell, names), *line.texts]) for line in table.lines]
    shown = markdown_table(map(escape_markdown, [*names, *table.heads]), lines, texts=len(names) + 1)
    return "\n".join([f"**{table.title}**", "", *([table.note, ""] if table.note else []), shown])


def markdown_table(heads: Iterable[str], lines: Iterable[Iterable[str]], *, texts: int | None = None) -> str:
    """A table in Markdown; columns after the first `texts`, by default none, are aligned to the right."""
    names = list(heads)
    rule = ["---" if texts is None or n < texts else "---:" for n in range(len(names))]
    return "\n".join(f"| {' | '.join(line)} |" for line in (names, rule, *lines))


def _factors(cells: Iterable[Cell | None]) -> list[str]:
    return list(dict.fromkeys(name for cell in cells for name, _ in cell or ()))


def _levels(cell: Cell | None, names: Sequence[str]) -> list[str]:
    return [dict(cell).get(name, "") if cell is not None else "all" for name in names]


def escape_markdown(text: str) -> str:
    """A text whose special characters Markdown shows as they are."""
    return text.replace("\\", "\\\\").replace("*", "\\*").replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")


def comma_separated(found: Sequence[Answer], baseline: str) -> str:
    """CSV with one line per cell, planner and metric; values in SI units, empty if undefined."""
    names = _factors(answer.cell for answer in found)
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
        pairs: list[object] = [""] * 9
        if gap is not None:
            counts = (gap.pairs, gap.unpaired, gap.won, gap.tied, gap.lost)
            pairs = [baseline, *counts, _number(gap.p_value), int(gap.survives), _number(gap.needed)]
        writer.writerow([*place, *own, *numbers, *pairs])
    return text.getvalue()


_CSV = (
    *("planner", "metric", "maps", "flown", "trials", "failed", "undefined"),
    *(f"{name}{part}" for name in ("mean", "median", "difference") for part in ("", "_low", "_high")),
    *("between_maps", "within_maps", "difference_between_maps", "difference_within_maps"),
    *("baseline", "pairs", "unpaired", "won", "tied", "lost", "p", "holm", "maps_needed"),
)


def _number(value: float) -> str:
    return "" if math.isnan(value) else repr(value)
