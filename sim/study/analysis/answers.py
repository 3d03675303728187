"""Answers of a study for each metric: every planner in every cell, and its difference from a baseline by map."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.facts.metrics.metric import Metric
from sim.study.analysis.groups import Group, Run
from sim.study.analysis.intervals import (
    LEVEL,
    NO_ESTIMATE,
    Estimate,
    compute_p_values,
    count_maps_needed,
    estimate_means,
    estimate_medians,
)
from sim.study.cells import Levels
from tracking.numerics.arrays import Array

_ROUNDING = 1e-9  # rounding error relative to the terms of a sum


@dataclass(frozen=True)
class Difference:
    """Difference of a planner and the baseline on the maps that both flew, repeat by repeat."""

    mean: Estimate
    pairs: int
    unpaired: int  # number of maps with a value of only one of the two
    won: int
    tied: int
    lost: int
    cells: int = 1  # number of cells over which each map's value is the mean
    p_value: float = 1.0  # p-value of the hypothesis that there is no difference
    survives: bool = False  # True if it survives Holm's correction for all differences shown with it
    needed: float = np.nan  # number of maps needed to find such a difference

    @property
    def significant(self) -> bool:
        """True if the two can be told apart, without a correction for other differences."""
        return self.p_value <= 1 - LEVEL


@dataclass(frozen=True)
class Tail:
    """The bad end of a metric's values over the maps, which a mean hides; NaN if there are none.

    It is the lower end if higher values are better, else the upper one.
    """

    decile: float = np.nan  # nine maps of ten are not worse than this
    worst: float = np.nan
    seed: int | None = None  # of the worst map, the first of several


NO_DIFFERENCE = Difference(NO_ESTIMATE, pairs=0, unpaired=0, won=0, tied=0, lost=0)


def differences(pairs: Mapping[Run, Array], metrics: Sequence[Metric], cells: int = 1) -> list[Difference]:
    """Differences by metric: mean, and numbers of maps won and lost, which are 0 if neither direction is better.

    pairs: as from `pair_differences`, or means of these over so many cells.
    """
    values = np.array([*pairs.values()]).reshape(len(pairs), len(metrics))
    maps = np.array([seed for seed, _ in pairs], dtype=object)
    gaps = average_by_map(values, maps)
    ranges = _find_ranges(metrics)
    judged = zip(estimate_means(gaps, ranges), compute_p_values(gaps, ranges), count_maps_needed(gaps), strict=True)
    found = []
    for j, (metric, widest, (mean, p_value, needed)) in enumerate(zip(metrics, ranges, judged, strict=True)):
        below, tied, above = (int(np.sum(np.sign(gaps[:, j]) == sign)) for sign in (-1, 0, 1))
        won, lost = {"lower": (below, above), "higher": (above, below), "neither": (0, 0)}[metric.better]
        paired_maps = below + tied + above
        counts = paired_maps, len(gaps) - paired_maps, won, tied, lost, cells
        found.append(Difference(mean.cut(-widest, widest), *counts, p_value=p_value, needed=needed))
    return found


def _find_ranges(metrics: Sequence[Metric]) -> list[float]:
    """Largest possible difference of two values of each metric; infinite if it has no bounds."""
    return [metric.most - metric.least for metric in metrics]


def average_by_map(values: Array, maps: NDArray[np.object_]) -> Array:
    """Means (maps, metrics) of values (N, metrics) over the finite repeats of each map; NaN if there are none.

    A mean of values that cancel except for rounding is zero, so that a tie counts as a tie.
    """
    seeds, place = np.unique(maps, return_inverse=True)
    counted = np.isfinite(values)
    sums, sizes, counts = np.zeros((3, len(seeds), values.shape[1]))
    np.add.at(sums, place, np.where(counted, values, 0.0))
    np.add.at(sizes, place, np.where(counted, np.abs(values), 0.0))
    np.add.at(counts, place, counted)
    sums[np.abs(sums) <= _ROUNDING * sizes] = 0.0
    found: Array = np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)
    return found


def pair_differences(group: Group, base: Group | None, metrics: Sequence[Metric]) -> dict[Run, Array]:
    """The group's metrics minus the baseline's on every run of either; NaN if one is missing or infinite."""
    ours, theirs = (g.list_by_run(metrics) if g else {} for g in (group, base))
    missing = np.full(len(metrics), np.nan)
    with np.errstate(invalid="ignore"):  # infinity minus infinity
        gaps = {run: ours.get(run, missing) - theirs.get(run, missing) for run in sorted(ours.keys() | theirs.keys())}
    return {run: np.where(np.isfinite(gap), gap, np.nan) for run, gap in gaps.items()}


class CommonValues(NamedTuple):
    """Values of several groups on the maps that all of them flew."""

    maps: list[int]  # (n,) seeds
    values: Array  # (n, groups)


def find_common_values(groups: Sequence[Group | None], metric: Metric) -> CommonValues:
    """Values of a metric on maps where all groups have finite ones in a common repeat."""
    tables = [group.list_by_run([metric]) if group else {} for group in groups]
    runs = sorted(set.intersection(*(set(table) for table in tables)))
    values = np.array([[table[run][0] for table in tables] for run in runs]).reshape(-1, len(groups))
    finite = np.isfinite(values).all(axis=1)
    maps = np.array([seed for seed, _ in runs], dtype=object)[finite]
    return CommonValues(np.unique(maps).tolist(), average_by_map(values[finite], maps))


@dataclass(frozen=True)
class Answer:
    """One metric of one planner in one cell, or over all cells."""

    cell: Levels | None  # None means all cells
    planner: str
    metric: Metric
    maps: int = 0  # number of maps with a finite value
    flown: int = 0  # number of maps, including those with failed trials
    trials: int = 0  # number of trials done, equal to that of maps if none is repeated
    failed: int = 0  # number of failed trials
    undefined: int = 0  # number of trials done without a finite value
    faulty: int = 0  # number of trials done with faults, such as those of a planner that raises
    mean: Estimate = NO_ESTIMATE
    median: Estimate = NO_ESTIMATE
    tail: Tail = Tail()
    failed_decisions: float = 0.0  # mean share of failed decisions over the trials done
    sample: str = "map"  # what each seed counts as, as of `Group`
    difference: Difference | None = None  # None for the baseline itself


def find_answers(groups: Sequence[Group], metrics: Sequence[Metric], baseline: str) -> list[Answer]:
    """Answers, metric by metric: the planners in every cell, then differences over all cells if there are several.

    Holm's correction is for all these differences together.
    """
    by_cell = {group.cell: group for group in groups if group.planner == baseline}
    pairs = {g: pair_differences(g, by_cell.get(g.cell), metrics) for g in groups if g.planner != baseline}
    own = {group: _answer_one(group, metrics) for group in groups}
    compared = {group: differences(gaps, metrics) for group, gaps in pairs.items()}
    overall = _compare_over_cells({group: gaps for group, gaps in pairs.items() if group.cell in by_cell}, metrics)
    found: list[Answer] = []
    for j in range(len(metrics)):
        for group, lines in own.items():
            found.append(replace(lines[j], difference=compared[group][j]) if group in compared else lines[j])
        samples = {group.planner: group.sample for group in groups if group.sample != "map"}
        found += [
            Answer(None, planner, metrics[j], sample=samples.get(planner, "map"), difference=total[j])
            for planner, total in overall.items()
        ]
    return _mark_survivors(found)


def holm(p_values: Sequence[float]) -> list[bool]:
    """Mask of the p-values that stay below 5 % after Holm's correction for all of them.

    Source: S. Holm, A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics, 1979.
    """
    order = np.argsort(p_values, kind="stable")
    adjusted = np.array(p_values)[order] * np.arange(len(p_values), 0, -1)
    kept = np.zeros(len(p_values), dtype=bool)
    kept[order] = np.maximum.accumulate(adjusted) <= 1 - LEVEL
    return kept.tolist()


def _mark_survivors(found: Sequence[Answer]) -> list[Answer]:
    """The answers, in which differences that survive the correction are marked; one without pairs is not a test."""
    compared = [a.difference for a in found if a.difference]
    kept = iter(holm([gap.p_value for gap in compared if gap.pairs]))
    judged = iter([replace(gap, survives=next(kept)) if gap.pairs else gap for gap in compared])
    return [replace(a, difference=next(judged)) if a.difference else a for a in found]


def find_tail(values: Array, seeds: Sequence[int], metric: Metric) -> Tail:
    """The tail of a metric's values (maps,), with the seeds of the maps; NaN and infinity are left out."""
    kept = np.flatnonzero(np.isfinite(values))
    if not len(kept):
        return Tail()
    sign = -1.0 if metric.better == "higher" else 1.0
    costs = sign * values[kept]
    last = int(np.argmax(costs))
    return Tail(sign * float(np.quantile(costs, 0.9)), float(values[kept[last]]), seeds[kept[last]])


def _answer_one(group: Group, metrics: Sequence[Metric]) -> list[Answer]:
    values = group.table(metrics)
    maps = np.array([row.seed for row in group.done], dtype=object)
    of_maps = average_by_map(values, maps)
    seeds = np.unique(maps).tolist()
    flown = len({row.seed for row in (*group.done, *group.failed)})
    undefined = np.sum(~np.isfinite(values), axis=0).tolist()
    return [
        Answer(
            group.cell,
            group.planner,
            metric,
            maps=int(np.isfinite(of_maps[:, j]).sum()),
            flown=flown,
            trials=len(group.done),
            failed=len(group.failed),
            undefined=undefined[j],
            failed_decisions=float(np.mean([row.metrics.get("failed_decisions", 0.0) for row in group.done] or [0.0])),
            sample=group.sample,
            faulty=sum(row.metrics.get("faults", 0.0) > 0.0 for row in group.done),
            mean=mean.cut(metric.least, metric.most),
            median=median,
            tail=find_tail(of_maps[:, j], seeds, metric),
        )
        for j, (metric, mean, median) in enumerate(
            zip(metrics, estimate_means(of_maps, _find_ranges(metrics)), estimate_medians(of_maps), strict=True)
        )
    ]


def map_means(group: Group, metric: Metric) -> Estimate:
    """Mean of a metric over the maps of a group."""
    return _answer_one(group, [metric])[0].mean


def map_points(groups: Sequence[Group], baseline: str, metric: Metric) -> dict[str, Array]:
    """Values (n, 2) of the baseline and of each other planner, in the metric's unit, on the maps that both flew."""
    bases = {group.cell: group for group in groups if group.planner == baseline}
    found: dict[str, list[Array]] = {group.planner: [] for group in groups if group.planner != baseline}
    for group in groups:
        if group.planner != baseline:
            found[group.planner].append(
                metric.scale * find_common_values([bases.get(group.cell), group], metric).values
            )
    return {planner: np.concatenate(parts) for planner, parts in found.items()}


def _compare_over_cells(
    pairs: Mapping[Group, Mapping[Run, Array]], metrics: Sequence[Metric]
) -> dict[str, list[Difference]]:
    """Differences of each planner that meets the baseline in several cells, as means over these cells, run by run.

    Cells may share the forests and people of a seed, so the samples are seeds. A run without its pair in some cell does
    not count.
    """
    found = {}
    undefined = np.full(len(metrics), np.nan)
    for planner in dict.fromkeys(group.planner for group in pairs):
        own = [gaps for group, gaps in pairs.items() if group.planner == planner]
        if len(own) > 1:
            runs = sorted(set().union(*own))
            each = np.array([[gaps.get(run, undefined) for gaps in own] for run in runs])  # (runs, cells, metrics)
            place = np.repeat(np.arange(len(runs)), len(own)).astype(object)
            mean = average_by_map(each.reshape(len(place), len(metrics)), place)
            overall = np.where(np.isfinite(each).all(axis=1), mean, np.nan)
            found[planner] = differences(dict(zip(runs, overall, strict=True)), metrics, len(own))
    return found
