"""Scores of a study: the place of each planner between a floor and a bound, on the maps that all three flew."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sim.analysis.cell_text import Cell, Placed
from sim.analysis.cells import Group
from sim.analysis.differences import map_values, paired
from sim.analysis.intervals import Estimate, means
from sim.analysis.planner_labels import baseline_of
from sim.evaluation.metric import Metric
from sim.study.cells import VIEW, with_options
from sim.study.study import Score

SCORE = Metric("place between floor and bound", unit="%", better="higher", scale=100.0, digits=0, least=-np.inf)


@dataclass(frozen=True)
class Place:
    """The score of a planner in one cell, or the mean over all cells: 0 that of the floor, 1 that of the bound."""

    cell: Cell | None  # None: all cells
    planner: str
    score: Estimate
    maps: int


def ends_of(rows: Sequence[Placed], score: Score, given: Mapping[str, str] = {}) -> tuple[str, str]:
    """Labels of floor and bound; InputError where the rows lack one."""
    bound = with_options(score.bound, {VIEW: "unlimited"})
    return baseline_of(rows, score.floor, given), baseline_of(rows, bound, given)


def places(groups: Sequence[Group], metric: Metric, floor: str, bound: str) -> list[Place]:
    """Cell by cell the place of each planner between floor and bound, then the mean over cells of those in all.

    A place is (m - f) / (b - f) of the means m, f and b of planner, floor and bound over the maps that all three flew.
    Its interval is that of `means` for the linearised ratio: a map counts with the place and its own residual
    (mᵢ - fᵢ - place (bᵢ - fᵢ)) / (b - f). A cell has no places where the bound is no better than the floor. In the mean
    over cells, a seed counts if it has all of them.
    """
    by_place = {(group.cell, group.planner): group for group in groups}
    cells = list(dict.fromkeys(group.cell for group in groups))
    values: dict[str, list[dict[int, float]]] = {}
    found = []
    for group in groups:
        ends = by_place.get((group.cell, floor)), by_place.get((group.cell, bound))
        if group.planner in (floor, bound) or None in ends:
            continue
        own = _by_map(group, *ends, metric)
        if own:
            found.append(_place(group.cell, group.planner, own))
            values.setdefault(group.planner, []).append(own)
    for planner, tables in values.items():
        if len(tables) == len(cells) > 1:
            seeds = [seed for seed in tables[0] if all(seed in table for table in tables)]
            found.append(_place(None, planner, {s: float(np.mean([t[s] for t in tables])) for s in seeds}))
    return found


def _place(cell: Cell | None, planner: str, values: Mapping[int, float]) -> Place:
    (score,) = means(np.array([*values.values()], dtype=float).reshape(-1, 1))
    return Place(cell, planner, score, len(values))


def _by_map(group: Group, floor: Group | None, bound: Group | None, metric: Metric) -> dict[int, float]:
    """The linearised places of maps, their mean is the place; nothing where the bound is not above the floor."""
    if bound is None:
        return {}
    gained, room = paired(group, floor, [metric]), paired(bound, floor, [metric])
    rooms = dict(zip(room.runs, room.values[:, 0].tolist(), strict=True))
    pairs = [(f, gain, rooms.get(f, np.nan)) for f, gain in zip(gained.runs, gained.values[:, 0], strict=True)]
    pairs = [(run, gain, whole) for run, gain, whole in pairs if np.isfinite(gain) and np.isfinite(whole)]
    if not pairs:
        return {}
    runs = [run for run, _, _ in pairs]
    of_maps = map_values(runs, np.array([(gain, whole) for _, gain, whole in pairs]))
    gain, whole = of_maps.mean(axis=0)
    if not (whole > 0 if metric.better == "higher" else whole < 0):
        return {}
    place = gain / whole
    linear = place + (of_maps[:, 0] - place * of_maps[:, 1]) / whole
    return dict(zip(dict.fromkeys(seed for seed, _ in runs), linear.tolist(), strict=True))
