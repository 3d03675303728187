"""Tables of a study's answers, scores and run times. A new column of the answers is one entry of `make_entries`."""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Literal, NamedTuple

from sim.facts.metrics.catalogue import METRICS
from sim.facts.metrics.metric import UNKNOWN, Metric
from sim.study.analysis.answers import NO_DIFFERENCE, Answer, Difference, map_means
from sim.study.analysis.groups import Group
from sim.study.analysis.intervals import MOST_MAPS, Estimate
from sim.study.analysis.labels import cell_text
from sim.study.analysis.normalised_score import Scored
from sim.study.cells import Levels

Value = str | float | None
WIDE, WIDEST = 100, 132  # characters, widths of terminals
FAILED = METRICS["failed_decisions"]


class Entry(NamedTuple):
    """An answer's entry in one column."""

    head: str  # the terminal starts a new line at a newline; other formats show a space
    text: str
    fields: dict[str, Value]  # columns of table.csv, in SI units; None and NaN are left empty
    known_of: Literal["answer", "cell", "difference"]  # "cell": empty over all cells; "difference": for the baseline
    from_width: int = 0  # characters, least width of a terminal that has room for the column
    if_empty: str = ""  # text where the entry is empty


def make_entries(answer: Answer, baseline: str) -> list[Entry]:
    """The entries of an answer from left to right; baseline: its label."""
    metric = answer.metric
    gap = answer.difference or NO_DIFFERENCE
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
        Entry("mean", answer.mean.text(metric), list_ends("mean", answer.mean), "cell"),
        Entry("median", answer.median.text(metric), list_ends("median", answer.median), "cell", WIDE),
        Entry(
            _name_decile(metric), metric.text(answer.tail.decile), {"bad_decile": answer.tail.decile}, "cell", WIDEST
        ),
        Entry(
            "greatest" if metric.better == "neither" else "worst",
            _format_worst(answer),
            {"worst": answer.tail.worst, "worst_seed": answer.tail.seed},
            "cell",
            WIDEST,
        ),
        Entry(
            "failed\ndecisions",
            FAILED.text(answer.failed_decisions) + " %",
            {"failed_decisions": answer.failed_decisions},
            "cell",
        ),
        Entry(
            f"minus {baseline}",
            ("* " if gap.survives else "") + gap.mean.text(metric, signed=True),
            list_ends("difference", gap.mean),
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
        Entry("maps\nneeded", _format_maps_needed(gap), {"maps_needed": gap.needed}, "difference", WIDE),
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


def list_ends(name: str, estimate: Estimate) -> dict[str, Value]:
    """Fields of an estimate: its value and the ends of its interval."""
    return {name: estimate.value, f"{name}_low": estimate.low, f"{name}_high": estimate.high}


def _format_maps(answer: Answer) -> str:
    if answer.cell is None:
        return f"{answer.difference.cells} cells" if answer.difference else ""
    count = str(answer.maps) if answer.maps == answer.flown else f"{answer.maps}/{answer.flown}"
    return count if answer.sample == "map" else f"{count} {answer.sample}s"


def _name_decile(metric: Metric) -> str:
    return f"{10 if metric.better == 'higher' else 90} %\nquantile"


def _format_worst(answer: Answer) -> str:
    tail = answer.tail
    return UNKNOWN if tail.seed is None else f"{answer.metric.text(tail.worst)} (seed {tail.seed})"


def _format_record(gap: Difference, metric: Metric) -> str:
    if metric.better == "neither" or not gap.pairs:
        return UNKNOWN
    return f"{gap.won}, {gap.tied}, {gap.lost}"


def _format_maps_needed(gap: Difference) -> str:
    if math.isinf(gap.needed):
        return f"> {MOST_MAPS}" if gap.mean.value else UNKNOWN
    return UNKNOWN if math.isnan(gap.needed) else str(round(gap.needed))


SCORES = "Normalised score of each planner [%]"  # title of the table


class TableRow(NamedTuple):
    """A row of a table."""

    cell: Levels | None  # empty if the study has no cells; None means all cells
    texts: list[str]


class Table(NamedTuple):
    """A table of the report."""

    title: str
    heads: list[str]
    rows: list[TableRow]
    metric: Metric | None = None  # the metric whose better direction the page names
    note: str = ""


def make_answer_tables(found: Sequence[Answer], baseline: str, *, width: float = math.inf) -> list[Table]:
    """The table of each metric, without the columns for which a terminal of this width [characters] has no room."""
    compared = any(answer.difference for answer in found)
    failing = any(answer.failed_decisions for answer in found)
    listed = []
    for metric, of_metric in groupby(found, lambda answer: answer.metric):
        rows = []
        heads: list[str] = []
        for answer in of_metric:
            entries = [entry for entry in make_entries(answer, baseline) if entry.from_width <= width]
            shown = [entry for entry in entries if compared or entry.known_of != "difference"]
            shown = [entry for entry in shown if failing or "failed_decisions" not in entry.fields]
            heads = [entry.head for entry in shown]
            rows.append(TableRow(answer.cell, [entry.text for entry in shown]))
        listed.append(Table(metric.title, heads, rows, metric))
    return listed


def make_score_table(scored: Scored, groups: Sequence[Group]) -> Table:
    """Table with a row per cell: the metric of floor and bound, and the score of each planner with its interval."""
    found, metric, ends = scored
    planners = list(dict.fromkeys(score.planner for score in found))
    by_key = {(group.cell, group.planner): group for group in groups}
    rows = []
    for cell, texts in _list_means_by_cell(found, planners, UNKNOWN):
        means = ["", ""] if cell is None else [metric.text(map_means(by_key[cell, end], metric).value) for end in ends]
        name = "mean over cells" if cell is None else cell_text(cell) or "all missions"
        rows.append(TableRow((), [name, *means, *texts]))
    note = (
        f"{metric.label}: 0 is that of {ends.floor}, 100 that of {ends.bound}, on the maps that all three flew. "
        "In brackets: 95 % intervals over the maps; how often these hold was not counted."
    )
    heads = ["cell", *(f"{end} [{metric.unit}]" for end in ends), *planners]
    return Table(SCORES, heads, rows, note=note)


def make_runtime_tables(found: Sequence[Answer]) -> list[Table]:
    """Tables with a row for each cell and a column for each planner, as in [Li22]."""
    own = [answer for answer in found if answer.cell is not None]
    planners = list(dict.fromkeys(answer.planner for answer in own))
    listed = []
    for metric, of_metric in groupby(own, lambda answer: answer.metric):
        by_cell = _list_means_by_cell(of_metric, planners, "")
        rows = [TableRow((), [cell_text(cell or ()) or "all missions", *texts]) for cell, texts in by_cell]
        listed.append(Table(metric.title, ["cell", *planners], rows, metric))
    return listed


def _list_means_by_cell(
    found: Iterable[Answer], planners: Sequence[str], missing: str
) -> Iterator[tuple[Levels | None, list[str]]]:
    """Each cell of the answers of one metric, with the mean of each planner."""
    for cell, of_cell in groupby(found, lambda answer: answer.cell):
        means = {answer.planner: answer.mean.text(answer.metric) for answer in of_cell}
        yield cell, [means.get(planner, missing) for planner in planners]
