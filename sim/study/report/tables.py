"""Tables of a study's answers, scores and run times, as texts for every format."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

from sim.facts.metrics.metric import UNKNOWN, Metric
from sim.study.analysis.answers import Answer, map_means
from sim.study.analysis.cell_text import cell_text
from sim.study.analysis.groups import Group
from sim.study.analysis.normalised_score import Scored
from sim.study.cells import Levels
from sim.study.report.answer_columns import make_entries

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


def make_answer_tables(found: Sequence[Answer], baseline: str, *, wide: bool = True) -> list[Table]:
    """The table of each metric; wide: False leaves out the columns for which a narrow terminal has no room."""
    compared = any(answer.difference for answer in found)
    listed = []
    for metric, of_metric in groupby(found, lambda answer: answer.metric):
        rows = []
        heads: list[str] = []
        for answer in of_metric:
            entries = [entry for entry in make_entries(answer, baseline) if wide or not entry.wide_only]
            shown = [entry for entry in entries if compared or entry.known_of != "difference"]
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
