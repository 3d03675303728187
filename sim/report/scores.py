"""Scores of a study as a table, a line a cell and a column a planner, and as a figure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import groupby

from sim.analysis.answers import map_means
from sim.analysis.cell_text import Cell, cell_text
from sim.analysis.cells import Group
from sim.analysis.metric_choice import metric_shown
from sim.analysis.score import SCORE, Place, ends_of, places
from sim.evaluation.metric import UNKNOWN, Metric
from sim.report.figures.pictures import Picture, score_picture
from sim.report.page_elements import paragraph, table
from sim.study.row import Row
from sim.study.score import Score

TITLE = "Place of each planner [%]"
_NOTHING: Mapping[str, str] = {}


@dataclass(frozen=True)
class Scored:
    """Scores as parts of a report."""

    lines: list[list[str]]  # heads first
    note: str
    drawn: list[Picture]

    @property
    def page(self) -> str:
        """The table as HTML."""
        heads, *rest = self.lines
        rows = []
        for first, *entries in rest:
            cells = "".join(f"<td>{escape(text)}</td>" for text in entries)
            rows.append(f'<tr><td class="name">{escape(first)}</td>{cells}</tr>')
        return paragraph(self.note) + table(heads, rows)

    @property
    def markdown(self) -> str:
        """The table as Markdown."""
        heads, *rest = self.lines
        rule = ["---", *["---:"] * (len(heads) - 1)]
        told = [f"| {' | '.join(text.replace('|', chr(92) + '|') for text in row)} |" for row in (heads, rule, *rest)]
        return "\n".join([f"**{TITLE}**", "", self.note, "", *told]) + "\n"


def scored_parts(
    rows: Sequence[Row], groups: Sequence[Group], score: Score | None, given: Mapping[str, str] = _NOTHING
) -> Scored | None:
    """The scores of groups of rows; None where the study has none, or no map has both floor and bound."""
    if score is None:
        return None
    ends, metric = ends_of(rows, score, given), metric_shown(score.metric)
    found = places(groups, metric, *ends)
    if not found:
        return None
    return Scored(_lines(found, groups, metric, ends), _note(metric, ends), [score_picture(found, ends)])


def _lines(found: Sequence[Place], groups: Sequence[Group], metric: Metric, ends: tuple[str, str]) -> list[list[str]]:
    """Heads, then a line a cell: the metric of floor and bound, and the place of each planner with its interval."""
    planners = list(dict.fromkeys(place.planner for place in found))
    by_place = {(group.cell, group.planner): group for group in groups}
    lines = [["cell", *(f"{end} [{metric.unit}]" for end in ends), *planners]]
    for cell, of_cell in groupby(found, lambda place: place.cell):
        scores = {place.planner: place.score.text(SCORE) for place in of_cell}
        means = [_mean(by_place.get((cell, end)), metric) if cell is not None else "" for end in ends]
        lines.append([_named(cell), *means, *(scores.get(planner, UNKNOWN) for planner in planners)])
    return lines


def _note(metric: Metric, ends: tuple[str, str]) -> str:
    floor, bound = ends
    text = f"{metric.label}: 0 is that of {floor}, 100 that of {bound}, on the maps that all three flew."
    return f"{text} In brackets: 95 % intervals over the maps; how often these hold was not counted."


def _mean(group: Group | None, metric: Metric) -> str:
    return UNKNOWN if group is None else metric.text(map_means(group, metric).value)


def _named(cell: Cell | None) -> str:
    return "mean over cells" if cell is None else cell_text(cell) or "all missions"
