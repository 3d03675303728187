"""The columns of an answer, as tables and table.csv show it. A new column is one entry of `make_entries`."""

import csv
import io
import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

from sim.facts.metrics.metric import UNKNOWN, Metric
from sim.study.analysis.answers import Answer
from sim.study.analysis.differences import NO_DIFFERENCE, Difference
from sim.study.analysis.intervals import MOST_MAPS, Estimate

Value = str | float | None


class Entry(NamedTuple):
    """An answer's entry in one column."""

    head: str  # the terminal starts a new line at a newline; other formats show a space
    text: str
    fields: dict[str, Value]  # columns of table.csv, in SI units; None and NaN are left empty
    known_of: Literal["answer", "cell", "difference"]  # "cell": empty over all cells; "difference": for the baseline
    wide_only: bool = False  # True if a narrow terminal leaves the column out
    if_empty: str = ""  # text where the entry is empty


def make_entries(answer: Answer, baseline: str) -> list[Entry]:
    """The entries of an answer from left to right; baseline: its label."""
    metric, gap = answer.metric, answer.difference or NO_DIFFERENCE
    entries = [
        Entry("planner", answer.planner, {"planner": answer.planner, "metric": metric.name}, "answer"),
        Entry(
            "maps",
            _format_maps(answer),
            {
                "maps": answer.maps,
                "flown": answer.flown,
                "trials": answer.trials,
                "failed": answer.failed,
                "undefined": answer.undefined,
            },
            "answer",
        ),
        Entry("mean", answer.mean.text(metric), _list_ends("mean", answer.mean), "cell"),
        Entry("median", answer.median.text(metric), _list_ends("median", answer.median), "cell", wide_only=True),
        Entry(
            f"minus {baseline}",
            ("* " if gap.survives else "") + gap.mean.text(metric, signed=True),
            _list_ends("difference", gap.mean),
            "difference",
            if_empty="baseline",
        ),
        Entry(
            "won, tied,\nlost",
            _format_record(gap, metric),
            {
                "baseline": baseline,
                "pairs": gap.pairs,
                "unpaired": gap.unpaired,
                "won": gap.won,
                "tied": gap.tied,
                "lost": gap.lost,
                "p": gap.p_value,
                "holm": int(gap.survives),
            },
            "difference",
        ),
        Entry("maps\nneeded", _format_maps_needed(gap), {"maps_needed": gap.needed}, "difference", wide_only=True),
    ]
    empty = {"cell": answer.cell is None, "difference": answer.difference is None, "answer": False}
    return [e._replace(text=e.if_empty, fields=dict.fromkeys(e.fields)) if empty[e.known_of] else e for e in entries]


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


def _list_ends(name: str, estimate: Estimate) -> dict[str, Value]:
    """Fields of an estimate: its value and the ends of its interval."""
    return {name: estimate.value, f"{name}_low": estimate.low, f"{name}_high": estimate.high}


def _format_maps(answer: Answer) -> str:
    if answer.cell is None:
        return f"{answer.difference.cells} cells" if answer.difference else ""
    return str(answer.maps) if answer.maps == answer.flown else f"{answer.maps}/{answer.flown}"


def _format_record(gap: Difference, metric: Metric) -> str:
    if metric.better == "neither" or not gap.pairs:
        return UNKNOWN
    return f"{gap.won}, {gap.tied}, {gap.lost}"


def _format_maps_needed(gap: Difference) -> str:
    if math.isinf(gap.needed):
        return f"> {MOST_MAPS}" if gap.mean.value else UNKNOWN
    return UNKNOWN if math.isnan(gap.needed) else str(round(gap.needed))
