"""The answers of a study as CSV."""

import csv
import io
import math
from collections.abc import Sequence

from sim.analysis.answers import Answer
from sim.report.answer_columns import make_entries


def format_csv(found: Sequence[Answer], baseline: str) -> str:
    """CSV with one line per cell, planner and metric; values in SI units, empty if undefined."""
    names = list(dict.fromkeys(name for answer in found for name, _ in answer.cell or ()))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for n, answer in enumerate(found):
        fields = {name: value for entry in make_entries(answer, baseline) for name, value in entry.fields.items()}
        if n == 0:
            writer.writerow([*names, *fields])
        levels = ["all"] * len(names) if answer.cell is None else [dict(answer.cell).get(name, "") for name in names]
        known = ("" if isinstance(value, float) and math.isnan(value) else value for value in fields.values())
        writer.writerow([*levels, *known])
    return text.getvalue()
