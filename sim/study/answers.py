"""What a study says of each metric: every cell and planner for itself, and against a baseline on the same maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sim.study.cells import Cell, Group
from sim.study.measures import Measure
from sim.study.statistics import NO_ESTIMATE, Estimate, means, medians
from tracking.compiled import Array


@dataclass(frozen=True)
class Difference:
    """A planner less the baseline, on the maps that both flew."""

    mean: Estimate
    pairs: int
    unpaired: int  # maps of either without a value of the other
    won: int
    tied: int
    lost: int
    cells: int = 1  # over which each map's value is the mean


@dataclass(frozen=True)
class Answer:
    """One metric of one planner in one cell, or over all cells."""

    cell: Cell | None  # None: all cells
    planner: str
    measure: Measure
    maps: int = 0  # done
    failed: int = 0
    undefined: int = 0  # done, without a finite value
    mean: Estimate = NO_ESTIMATE
    median: Estimate = NO_ESTIMATE
    difference: Difference | None = None  # None of the baseline itself


def answers(groups: Sequence[Group], measures: Sequence[Measure], baseline: str) -> list[Answer]:
    """Metric by metric: every cell's planners, then the differences over all cells if there are several."""
    own = [_own(group, measures) for group in groups]
    by_cell = {group.cell: group for group in groups if group.planner == baseline}
    pairs = [None if g.planner == baseline else paired(g, by_cell.get(g.cell), measures) for g in groups]
    differences = [None if p is None else p.differences(measures) for p in pairs]
    overall = _overall([g for g in groups if g.cell in by_cell], dict(zip(groups, pairs, strict=True)), measures)
    found: list[Answer] = []
    for j, measure in enumerate(measures):
        for group, (mean, median, undefined), difference in zip(groups, own, differences, strict=True):
            counts = len(group.done), len(group.failed), undefined[j]
            compared = None if difference is None else difference[j]
            found.append(Answer(group.cell, group.planner, measure, *counts, mean[j], median[j], compared))
        found += [Answer(None, planner, measure, difference=total[j]) for planner, total in overall.items()]
    return found


def _own(group: Group, measures: Sequence[Measure]) -> tuple[list[Estimate], list[Estimate], list[int]]:
    """Means, medians and numbers of undefined values, metric by metric."""
    values = np.array([group.values(m.name) for m in measures]).reshape(len(measures), len(group.done)).T
    return means(values), medians(values), np.sum(~np.isfinite(values), axis=0).tolist()


@dataclass(frozen=True, eq=False)
class Pairs:
    """A group less the baseline, by seed."""

    seeds: tuple[int, ...]  # of either
    values: Array  # (seeds, metrics), NaN where one of both is missing, undefined or infinite

    def differences(self, measures: Sequence[Measure], cells: int = 1) -> list[Difference]:
        """Metric by metric the mean, and how many maps went which way; where neither way is better, none is won."""
        found = []
        for mean, measure, gaps in zip(means(self.values), measures, self.values.T, strict=True):
            below, tied, above = (int(np.sum(np.sign(gaps) == sign)) for sign in (-1, 0, 1))
            won, lost = {"lower": (below, above), "higher": (above, below), "neither": (0, 0)}[measure.better]
            pairs = below + tied + above
            found.append(Difference(mean, pairs, len(self.seeds) - pairs, won, tied, lost, cells))
        return found


def paired(group: Group, base: Group | None, measures: Sequence[Measure]) -> Pairs:
    """The metrics of the group less the baseline's, on every seed of either."""
    ours, theirs = (_by_seed(g, measures) for g in (group, base))
    seeds = tuple(sorted(ours.keys() | theirs.keys()))
    with np.errstate(invalid="ignore"):  # infinity less infinity
        gaps = np.array([ours.get(s, _missing(measures)) - theirs.get(s, _missing(measures)) for s in seeds])
    gaps = gaps.reshape(len(seeds), len(measures))
    return Pairs(seeds, np.where(np.isfinite(gaps), gaps, np.nan))


def paired_values(group: Group, base: Group | None, measure: Measure) -> Array:
    """The baseline's and the group's values (n, 2) on the seeds where both are finite."""
    ours, theirs = (_by_seed(g, [measure]) for g in (group, base))
    both = np.array([(theirs[s][0], ours[s][0]) for s in sorted(ours.keys() & theirs.keys())]).reshape(-1, 2)
    kept: Array = both[np.isfinite(both).all(axis=1)]
    return kept


def _by_seed(group: Group | None, measures: Sequence[Measure]) -> dict[int, Array]:
    """The metrics of each seed; all NaN of one that failed."""
    if group is None:
        return {}
    values = np.array([group.values(m.name) for m in measures]).reshape(len(measures), len(group.done)).T
    failed = {row.seed: _missing(measures) for row in group.failed}
    return failed | {row.seed: line for row, line in zip(group.done, values, strict=True)}


def _missing(measures: Sequence[Measure]) -> Array:
    return np.full(len(measures), np.nan)


def _overall(
    groups: Sequence[Group], pairs: Mapping[Group, Pairs | None], measures: Sequence[Measure]
) -> dict[str, list[Difference]]:
    """Of each planner that meets the baseline in several cells: the mean over these cells, seed by seed.

    Cells may share people and forests of a seed, so seeds are what is resampled; a seed that lacks its pair in a
    cell does not count.
    """
    found = {}
    for planner in dict.fromkeys(group.planner for group in groups):
        own = [p for p in (pairs[group] for group in groups if group.planner == planner) if p is not None]
        if len(own) > 1:
            seeds = tuple(sorted({seed for p in own for seed in p.seeds}))
            tables = [dict(zip(p.seeds, p.values, strict=True)) for p in own]
            lines = [np.mean([t.get(seed, _missing(measures)) for t in tables], axis=0) for seed in seeds]
            found[planner] = Pairs(seeds, np.array(lines)).differences(measures, len(own))
    return found
