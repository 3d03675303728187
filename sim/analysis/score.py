"""Normalised scores of a study: planners between a floor and a bound, on the maps that all three flew."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planning.planner_text import with_options
from sim.analysis.cell_text import Cell, Placed
from sim.analysis.cells import Group
from sim.analysis.differences import common_values
from sim.analysis.intervals import Estimate, means
from sim.analysis.metric_choice import metric_shown
from sim.analysis.planner_labels import baseline_of
from sim.evaluation.metric import Metric
from sim.study.cells import VIEW
from sim.study.study import ScoreScale
from sim.study.tasks import Row

SCORE = Metric("normalised score", unit="%", better="higher", scale=100.0, digits=0)


@dataclass(frozen=True)
class NormalisedScore:
    """The score of a planner in one cell, or the mean over all cells: that of the floor is 0, that of the bound 1."""

    cell: Cell | None  # None: all cells
    planner: str
    estimate: Estimate
    maps: int


class Scored(NamedTuple):
    """Scores of planners, and of which metric between which ends."""

    scores: list[NormalisedScore]
    metric: Metric
    ends: tuple[str, str]  # floor and bound


def scored(
    rows: Sequence[Row], groups: Sequence[Group], score: ScoreScale | None, given: Mapping[str, str] = {}
) -> Scored | None:
    """The scores of groups of rows; None where the study has none, or no map has both floor and bound."""
    if score is None:
        return None
    ends, metric = ends_of(rows, score, given), metric_shown(score.metric)
    found = scores(groups, metric, *ends)
    return Scored(found, metric, ends) if found else None


def ends_of(rows: Sequence[Placed], score: ScoreScale, given: Mapping[str, str] = {}) -> tuple[str, str]:
    """Labels of floor and bound; InputError where the rows lack one."""
    bound = with_options(score.bound, {VIEW: "unlimited"})
    return baseline_of(rows, score.floor, given, "score.floor"), baseline_of(rows, bound, given, "score.bound")


def scores(groups: Sequence[Group], metric: Metric, floor: str, bound: str) -> list[NormalisedScore]:
    """Cell by cell the score of each planner, then the mean over cells of planners that are in all of them.

    A score is (m - f) / (b - f) of the means m, f and b of planner, floor and bound over the maps that all three flew.
    Its interval is that of `means` for the linearised ratio: a map counts with the score and its own residual
    (mᵢ - fᵢ - score (bᵢ - fᵢ)) / (b - f). A cell has no scores where the bound is no better than the floor. In the mean
    over cells, a seed counts if it has all of them.
    """
    by_key = {(group.cell, group.planner): group for group in groups}
    cells = list(dict.fromkeys(group.cell for group in groups))
    values: dict[str, list[dict[int, float]]] = {}
    found = []
    for group in groups:
        low, high = by_key.get((group.cell, floor)), by_key.get((group.cell, bound))
        if group.planner not in (floor, bound) and low and high and (own := _by_map(group, low, high, metric)):
            found.append(_score(group.cell, group.planner, own))
            values.setdefault(group.planner, []).append(own)
    for planner, tables in values.items():
        if len(tables) == len(cells) > 1:
            seeds = [seed for seed in tables[0] if all(seed in table for table in tables)]
            found.append(_score(None, planner, {s: float(np.mean([t[s] for t in tables])) for s in seeds}))
    return found


def _score(cell: Cell | None, planner: str, values: Mapping[int, float]) -> NormalisedScore:
    (estimate,) = means(np.array([*values.values()], dtype=float).reshape(-1, 1))
    return NormalisedScore(cell, planner, estimate, len(values))


def _by_map(group: Group, floor: Group, bound: Group, metric: Metric) -> dict[int, float]:
    """The linearised scores of maps, their mean is the score; nothing where the bound is not above the floor."""
    maps, values = common_values([group, floor, bound], metric)
    gains, rooms = values[:, 0] - values[:, 1], values[:, 2] - values[:, 1]
    room = float(rooms.mean()) if maps else 0.0
    if not (room > 0 if metric.better == "higher" else room < 0):
        return {}
    score = float(gains.mean()) / room
    return dict(zip(maps, (score + (gains - score * rooms) / room).tolist(), strict=True))
