"""Scores of a study as a table, a line a cell and a column a planner, and as a figure."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

from sim.analysis.answers import map_means
from sim.analysis.cell_text import Cell, cell_text
from sim.analysis.cells import Group
from sim.analysis.metric_choice import metric_shown
from sim.analysis.score import SCORE, Place, ends_of, places
from sim.evaluation.metric import UNKNOWN, Metric
from sim.report.tables import Table
from sim.study.study import Score
from sim.study.tasks import Row

TITLE = "Place of each planner [%]"


class Scored(NamedTuple):
    """Scores as parts of a report."""

    table: Table
    places: list[Place]
    ends: tuple[str, str]  # floor and bound


def scored_parts(
    rows: Sequence[Row], groups: Sequence[Group], score: Score | None, given: Mapping[str, str] = {}
) -> Scored | None:
    """The scores of groups of rows; None where the study has none, or no map has both floor and bound."""
    if score is None:
        return None
    ends, metric = ends_of(rows, score, given), metric_shown(score.metric)
    found = places(groups, metric, *ends)
    return Scored(_table(found, groups, metric, ends), found, ends) if found else None


def _table(found: Sequence[Place], groups: Sequence[Group], metric: Metric, ends: tuple[str, str]) -> Table:
    """A line a cell: the metric of floor and bound, and the place of each planner with its interval."""
    planners = list(dict.fromkeys(place.planner for place in found))
    by_place = {(group.cell, group.planner): group for group in groups}
    lines = []
    for cell, of_cell in groupby(found, lambda place: place.cell):
        scores = {place.planner: place.score.text(SCORE) for place in of_cell}
        means = [_mean(by_place.get((cell, end)), metric) if cell is not None else "" for end in ends]
        lines.append([_named(cell), *means, *(scores.get(planner, UNKNOWN) for planner in planners)])
    heads = ["cell", *(f"{end} [{metric.unit}]" for end in ends), *planners]
    return Table(TITLE, heads, [((), line) for line in lines], note=_note(metric, ends))


def _note(metric: Metric, ends: tuple[str, str]) -> str:
    floor, bound = ends
    text = f"{metric.label}: 0 is that of {floor}, 100 that of {bound}, on the maps that all three flew."
    return f"{text} In brackets: 95 % intervals over the maps; how often these hold was not counted."


def _mean(group: Group | None, metric: Metric) -> str:
    return UNKNOWN if group is None else metric.text(map_means(group, metric).value)


def _named(cell: Cell | None) -> str:
    return "mean over cells" if cell is None else cell_text(cell) or "all missions"
