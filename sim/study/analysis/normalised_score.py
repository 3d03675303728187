"""Normalised scores of a study: planners between a floor and a bound, on the maps that all three flew."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from planning.planner_loading import add_options
from sim.facts.metrics.metric import Metric
from sim.study.analysis.answers import Answer, find_common_values
from sim.study.analysis.groups import Group
from sim.study.analysis.intervals import estimate_means
from sim.study.analysis.labels import find_baseline
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.cells import VIEW, Levels
from sim.study.definition import ScoreScale
from sim.study.trials import TrialPlace, TrialRow

SCORE = Metric("normalised score", unit="%", better="higher", scale=100.0, digits=0)


class Ends(NamedTuple):
    """Labels of the planners with the scores 0 and 100 %."""

    floor: str
    bound: str


class Scored(NamedTuple):
    """Scores of planners, with their metric and their ends."""

    scores: list[Answer]
    metric: Metric
    ends: Ends


def score_planners(
    rows: Sequence[TrialRow], groups: Sequence[Group], score: ScoreScale | None, given: Mapping[str, str] = {}
) -> Scored | None:
    """Scores of groups of rows; None if the study has no score, or no map has both floor and bound."""
    if score is None:
        return None
    ends = find_score_ends(rows, score, given)
    metric = find_shown_metric(score.metric)
    found = compute_scores(groups, metric, ends)
    return Scored(found, metric, ends) if found else None


def find_score_ends(rows: Sequence[TrialPlace], score: ScoreScale, given: Mapping[str, str] = {}) -> Ends:
    """Labels of floor and bound; InputError if the rows lack one."""
    bound = add_options(score.bound, {VIEW: "unlimited"})
    return Ends(
        floor=find_baseline(rows, score.floor, given, "score.floor"),
        bound=find_baseline(rows, bound, given, "score.bound"),
    )


def compute_scores(groups: Sequence[Group], metric: Metric, ends: Ends) -> list[Answer]:
    """Scores of each planner, cell by cell, then the mean over cells of planners that are in all of them.

    The floor has the score 0, and the bound 1: a score is (m - f) / (b - f), where m, f and b are the means of planner,
    floor and bound over the maps that all three flew. Its interval is that of `estimate_means` for the linearised
    ratio: a map's value is the score plus the residual (mᵢ - fᵢ - score (bᵢ - fᵢ)) / (b - f). A cell in which the bound
    is no better than the floor has no scores. The mean over cells counts the seeds that have a value in all of them.
    """
    by_key = {(group.cell, group.planner): group for group in groups}
    cells = list(dict.fromkeys(group.cell for group in groups))
    values: dict[str, list[dict[int, float]]] = {}
    found = []
    for group in groups:
        floor = by_key.get((group.cell, ends.floor))
        bound = by_key.get((group.cell, ends.bound))
        if group.planner in ends or floor is None or bound is None:
            continue
        if own := _score_maps(group, floor, bound, metric):
            found.append(_score(group.cell, group.planner, own))
            values.setdefault(group.planner, []).append(own)
    for planner, tables in values.items():
        if len(tables) == len(cells) > 1:
            seeds = [seed for seed in tables[0] if all(seed in table for table in tables)]
            found.append(_score(None, planner, {s: float(np.mean([t[s] for t in tables])) for s in seeds}))
    return found


def _score(cell: Levels | None, planner: str, values: Mapping[int, float]) -> Answer:
    (estimate,) = estimate_means(np.array([*values.values()], dtype=float).reshape(-1, 1))
    return Answer(cell, planner, SCORE, maps=len(values), mean=estimate)


def _score_maps(group: Group, floor: Group, bound: Group, metric: Metric) -> dict[int, float]:
    """Linearised scores of maps, with the score as their mean; empty if the bound is no better than the floor."""
    maps, values = find_common_values([group, floor, bound], metric)
    gains = values[:, 0] - values[:, 1]
    rooms = values[:, 2] - values[:, 1]
    room = float(rooms.mean()) if maps else 0.0
    if not (room > 0 if metric.better == "higher" else room < 0):
        return {}
    score = float(gains.mean()) / room
    return dict(zip(maps, (score + (gains - score * rooms) / room).tolist(), strict=True))
