"""The answers of a study as Markdown and as CSV."""

import csv
import io
import math
from collections.abc import Iterable, Sequence

from sim.analysis.answers import Answer
from sim.analysis.cell_text import Cell
from sim.report.answer_columns import make_entries
from sim.report.sentences import notes, shortfalls
from sim.report.tables import Table, make_answer_tables


def format_markdown(found: Sequence[Answer], baseline: str, scored: Table | None = None) -> str:
    """Markdown with one table per metric, after the table of scores if there is one."""
    parts = [_table_section(table) for table in ([scored] if scored else []) + make_answer_tables(found, baseline)]
    said = "\n".join(f"- {escape_markdown(line)}" for line in (*notes(found), *shortfalls(found)))
    return "\n\n".join([*parts, said]) + "\n"


def _table_section(table: Table) -> str:
    names = _factors(row.cell for row in table.rows)
    rows = [map(escape_markdown, [*_levels(row.cell, names), *row.texts]) for row in table.rows]
    shown = format_markdown_table(map(escape_markdown, [*names, *table.heads]), rows, texts=len(names) + 1)
    return "\n".join([f"**{table.title}**", "", *([table.note, ""] if table.note else []), shown])


def format_markdown_table(heads: Iterable[str], rows: Iterable[Iterable[str]], *, texts: int | None = None) -> str:
    """A table in Markdown; columns after the first `texts`, by default none, are aligned to the right."""
    names = list(heads)
    rule = ["---" if texts is None or n < texts else "---:" for n in range(len(names))]
    return "\n".join(f"| {' | '.join(line)} |" for line in (names, rule, *rows))


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
    for n, answer in enumerate(found):
        fields = {name: value for entry in make_entries(answer, baseline) for name, value in entry.fields.items()}
        if n == 0:
            writer.writerow([*names, *fields])
        known = ("" if isinstance(value, float) and math.isnan(value) else value for value in fields.values())
        writer.writerow([*_levels(answer.cell, names), *known])
    return text.getvalue()
