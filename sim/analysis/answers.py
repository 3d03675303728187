"""Answers of a study on each metric: every cell and planner by itself, and against a baseline on the same maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim.analysis.cell_text import Cell
from sim.analysis.cells import Group
from sim.analysis.statistics import (
    LEVEL,
    NO_ESTIMATE,
    NO_SPREAD,
    Estimate,
    Spread,
    chances,
    holm,
    maps_needed,
    means,
    medians,
    spreads,
)
from sim.evaluation.metric import Metric
from sim.study.row import Row
from tracking.numerics.arrays import Array

Flight = tuple[int, int]  # seed and repeat


@dataclass(frozen=True)
class Difference:
    """A planner less the baseline, on the maps that both flew, repeat by repeat."""

    mean: Estimate
    pairs: int
    unpaired: int  # maps of either without a value of the other
    won: int
    tied: int
    lost: int
    cells: int = 1  # over which each map's value is the mean
    chance: float = 1.0  # p-value of no difference
    survives: bool = False  # Holm's correction for all differences shown with it
    spread: Spread = NO_SPREAD
    needed: float = np.nan  # maps that tell such a difference apart

    @property
    def told(self) -> bool:
        """True if the two can be told apart, this difference taken by itself."""
        return self.chance <= 1 - LEVEL


@dataclass(frozen=True)
class Answer:
    """One metric of one planner in one cell, or over all cells."""

    cell: Cell | None  # None: all cells
    planner: str
    metric: Metric
    maps: int = 0  # with a finite value
    flown: int = 0  # maps, those that failed too
    trials: int = 0  # done; as many as maps where none is repeated
    failed: int = 0  # trials
    undefined: int = 0  # trials done, without a finite value
    mean: Estimate = NO_ESTIMATE
    median: Estimate = NO_ESTIMATE
    spread: Spread = NO_SPREAD
    difference: Difference | None = None  # None of the baseline itself


def answers(groups: Sequence[Group], metrics: Sequence[Metric], baseline: str) -> list[Answer]:
    """Metric by metric: every cell's planners, then the differences over all cells if there are several.

    All differences together are what Holm's correction is for.
    """
    own = [_own(group, metrics) for group in groups]
    by_cell = {group.cell: group for group in groups if group.planner == baseline}
    pairs = [None if g.planner == baseline else paired(g, by_cell.get(g.cell), metrics) for g in groups]
    differences = [None if p is None else p.differences(metrics) for p in pairs]
    overall = _overall([g for g in groups if g.cell in by_cell], dict(zip(groups, pairs, strict=True)), metrics)
    found: list[Answer] = []
    for j in range(len(metrics)):
        for lines, difference in zip(own, differences, strict=True):
            found.append(lines[j] if difference is None else replace(lines[j], difference=difference[j]))
        found += [Answer(None, planner, metrics[j], difference=total[j]) for planner, total in overall.items()]
    return _judged(found)


def _judged(found: Sequence[Answer]) -> list[Answer]:
    """The answers, their differences judged together."""
    compared = [a.difference for a in found if a.difference is not None]
    kept = iter(holm([difference.chance for difference in compared]))
    return [
        a if a.difference is None else replace(a, difference=replace(a.difference, survives=next(kept))) for a in found
    ]


def _own(group: Group, metrics: Sequence[Metric]) -> list[Answer]:
    """Answers of a group, metric by metric."""
    flights = [(row.seed, row.repeat) for row in group.done]
    values = _values(group.done, metrics)
    of_maps = _by_map(flights, values)
    bounds = [(metric.least, metric.most) for metric in metrics]
    flown = len({row.seed for row in (*group.done, *group.failed)})
    undefined = np.sum(~np.isfinite(values), axis=0).tolist()
    spread = spreads(values, np.array([seed for seed, _ in flights], dtype=object))
    return [
        Answer(
            *(group.cell, group.planner, metric),
            maps=int(np.isfinite(of_maps[:, j]).sum()),
            flown=flown,
            trials=len(flights),
            failed=len(group.failed),
            undefined=undefined[j],
            mean=_bounded(mean, *bounds[j]),
            median=median,
            spread=spread[j],
        )
        for j, (metric, mean, median) in enumerate(zip(metrics, means(of_maps), medians(of_maps), strict=True))
    ]


def map_means(group: Group, metric: Metric) -> Estimate:
    """The mean over the maps of a group."""
    flights = [(row.seed, row.repeat) for row in group.done]
    return _bounded(means(_by_map(flights, _values(group.done, [metric])))[0], metric.least, metric.most)


def _bounded(estimate: Estimate, least: float, most: float) -> Estimate:
    """The estimate, its interval cut where no value can be."""
    return replace(estimate, low=max(estimate.low, least), high=min(estimate.high, most))


@dataclass(frozen=True, eq=False)
class Pairs:
    """A group less the baseline, by flight."""

    flights: tuple[Flight, ...]  # of either
    values: Array  # (flights, metrics), NaN where one of both is missing, undefined or infinite

    def differences(self, metrics: Sequence[Metric], cells: int = 1) -> list[Difference]:
        """Metric by metric the mean, and how many maps went which way; where neither way is better, none is won."""
        gaps = _by_map(self.flights, self.values)
        seeds = np.array([seed for seed, _ in self.flights], dtype=object)
        judged = zip(means(gaps), chances(gaps), spreads(self.values, seeds), maps_needed(gaps), strict=True)
        found = []
        for j, (mean, chance, spread, needed) in enumerate(judged):
            below, tied, above = (int(np.sum(np.sign(gaps[:, j]) == sign)) for sign in (-1, 0, 1))
            won, lost = {"lower": (below, above), "higher": (above, below), "neither": (0, 0)}[metrics[j].better]
            pairs = below + tied + above
            counts = pairs, len(gaps) - pairs, won, tied, lost, cells
            found.append(Difference(mean, *counts, chance=chance, spread=spread, needed=needed))
        return found


def paired(group: Group, base: Group | None, metrics: Sequence[Metric]) -> Pairs:
    """The metrics of the group less the baseline's, on every flight of either."""
    ours, theirs = (_by_flight(g, metrics) for g in (group, base))
    flights = tuple(sorted(ours.keys() | theirs.keys()))
    missing = _missing(metrics)
    with np.errstate(invalid="ignore"):  # infinity less infinity
        gaps = np.array([ours.get(f, missing) - theirs.get(f, missing) for f in flights])
    gaps = gaps.reshape(len(flights), len(metrics))
    return Pairs(flights, np.where(np.isfinite(gaps), gaps, np.nan))


def paired_values(group: Group, base: Group | None, metric: Metric) -> Array:
    """The baseline's and the group's values (n, 2) on the maps where both are finite in some repeat."""
    ours, theirs = (_by_flight(g, [metric]) for g in (group, base))
    flights = sorted(ours.keys() & theirs.keys())
    both = np.array([(theirs[f][0], ours[f][0]) for f in flights]).reshape(-1, 2)
    finite = np.isfinite(both).all(axis=1)
    return _by_map([f for f, kept in zip(flights, finite, strict=True) if kept], both[finite])


def _by_map(flights: Sequence[Flight], values: Array) -> Array:
    """Means (maps, metrics) over the repeats of each map that have a finite value; NaN where none has."""
    maps = list(dict.fromkeys(seed for seed, _ in flights))
    places = {seed: i for i, seed in enumerate(maps)}
    place = np.array([places[seed] for seed, _ in flights], dtype=np.int64)
    counted = np.isfinite(values)
    sums, counts = np.zeros((len(maps), values.shape[1])), np.zeros((len(maps), values.shape[1]))
    np.add.at(sums, place, np.where(counted, values, 0.0))
    np.add.at(counts, place, counted)
    found: Array = np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)
    return found


def _values(rows: Sequence[Row], metrics: Sequence[Metric]) -> Array:
    """The metrics (rows, metrics); NaN where they are undefined."""
    table = [[row.metrics.get(metric.name, np.nan) for metric in metrics] for row in rows]
    return np.array(table, dtype=float).reshape(len(rows), len(metrics))


def _by_flight(group: Group | None, metrics: Sequence[Metric]) -> dict[Flight, Array]:
    """The metrics of each flight; all NaN of one that failed."""
    if group is None:
        return {}
    failed = {(row.seed, row.repeat): _missing(metrics) for row in group.failed}
    lines = zip(group.done, _values(group.done, metrics), strict=True)
    return failed | {(row.seed, row.repeat): line for row, line in lines}


def _missing(metrics: Sequence[Metric]) -> Array:
    return np.full(len(metrics), np.nan)


def _overall(
    groups: Sequence[Group], pairs: Mapping[Group, Pairs | None], metrics: Sequence[Metric]
) -> dict[str, list[Difference]]:
    """Of each planner that meets the baseline in several cells: the mean over these cells, flight by flight.

    Cells may share people and forests of a seed, so seeds are what is counted; a flight that lacks its pair in a cell
    does not count.
    """
    found = {}
    for planner in dict.fromkeys(group.planner for group in groups):
        own = [p for p in (pairs[group] for group in groups if group.planner == planner) if p is not None]
        if len(own) > 1:
            flights = tuple(sorted({flight for p in own for flight in p.flights}))
            tables = [dict(zip(p.flights, p.values, strict=True)) for p in own]
            lines = [np.mean([t.get(flight, _missing(metrics)) for t in tables], axis=0) for flight in flights]
            found[planner] = Pairs(flights, np.array(lines)).differences(metrics, len(own))
    return found
