"""Levels of a study's factors compared with the ones before and the best, and chosen on some maps for others."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.facts.metrics.metric import Metric
from sim.study.analysis.answers import Difference, average_by_map, differences, holm, pair_differences
from sim.study.analysis.groups import Group
from sim.study.analysis.intervals import NO_ESTIMATE, Estimate, compute_p_values, estimate_means
from sim.study.cells import Levels
from tracking.numerics.arrays import Array


@dataclass(frozen=True)
class Threshold:
    """A bound that a metric is to meet."""

    metric: str
    value: float  # before scaling
    at_least: bool = True  # False if it is an upper bound

    def check(self, values: Array) -> NDArray[np.bool_]:
        """Mask of the values that meet it."""
        return values >= self.value if self.at_least else values <= self.value

    def text(self, metric: Metric) -> str:
        """The threshold in the metric's unit, such as at least 90 %."""
        return f"at {'least' if self.at_least else 'most'} {self.value * metric.scale:g} {metric.unit}".rstrip()


@dataclass(frozen=True)
class Measured:
    """A metric over the maps of a group."""

    maps: int = 0  # number with a value
    mean: Estimate = NO_ESTIMATE
    met: int = 0  # number of maps whose value meets the threshold
    sure: float = np.nan  # confidence that the mean over all maps meets it: one minus the one-sided p-value


class LevelAnswer(NamedTuple):
    """One level of a factor, for one planner at one combination of levels of the other factors."""

    planner: str
    factor: str
    others: Levels
    level: str
    found: Measured
    step: Difference | None  # minus the level before; None for the first
    gap: Difference | None  # minus the best level; None for the best, and if neither direction is better


class Choice(NamedTuple):
    """Levels chosen on the first half of the seeds, and judged on the others."""

    planner: str
    others: Levels  # those of factors that are not chosen
    options: int  # number of combinations among which it is chosen
    chosen_on: list[int]
    judged_on: list[int]
    levels: Levels | None = None  # the choice; None if no combination meets the threshold
    before: Measured = Measured()  # on the maps of the choice
    after: Measured = Measured()  # on the other maps
    rival: Levels | None = None  # the next best on the maps of the choice; None if the choice is the cheapest
    gap: Difference | None = None  # the choice minus its rival on the other maps


def find_levels(
    groups: Sequence[Group], metric: Metric, factors: Mapping[str, Sequence[str]], threshold: Threshold | None = None
) -> list[LevelAnswer]:
    """The levels of each factor: planner by planner, for all combinations of the other factors with several levels.

    factors: the factors that vary, with their levels in order. Differences are of the same seeds. Holm's correction is
    for all differences of a factor; two levels that are compared twice count once.
    """
    measured = {group: _measure(group, metric, threshold) for group in groups}
    found: list[LevelAnswer] = []
    for factor, levels in factors.items():
        lines: dict[tuple[Levels, str], list[Group]] = {}
        for group in groups:
            lines.setdefault((_drop(group.cell, [factor]), group.planner), []).append(group)
        entries: list[tuple[str, Levels, Group, Group | None, Group | None]] = []
        for (others, planner), line in lines.items():
            line.sort(key=lambda group: levels.index(dict(group.cell)[factor]))
            ranked = _rank([measured[group] for group in line], metric)
            for k, group in enumerate(line if len(line) > 1 else ()):
                best = line[ranked[0]] if ranked and ranked[0] != k else None
                entries.append((planner, others, group, line[k - 1] if k else None, best))
        pairs = dict.fromkeys((group, other) for _, _, group, *two in entries for other in two if other)
        gaps = _compare_pairs(pairs, metric)
        for planner, others, group, before, best in entries:
            step, gap = (gaps[group, other] if other else None for other in (before, best))
            level = dict(group.cell)[factor]
            found.append(LevelAnswer(planner, factor, others, level, measured[group], step, gap))
    return found


def find_choices(
    groups: Sequence[Group], metric: Metric, chosen: Collection[str], threshold: Threshold | None = None
) -> list[Choice]:
    """For each planner, the best or cheapest combination of the chosen factors, at each of the other factors' levels.

    It is chosen on the first half of the seeds and judged on the others, because on the maps of the choice the chosen
    one looks better than it is. With a threshold, it is the first in the order of `groups` whose mean meets it.
    Empty if there are no seeds left to judge on.
    """
    seeds = sorted({row.seed for group in groups for row in (*group.done, *group.failed)})
    halves = seeds[: -(-len(seeds) // 2)], seeds[-(-len(seeds) // 2) :]
    lines: dict[tuple[str, Levels], list[Group]] = {}
    for group in groups:
        lines.setdefault((group.planner, _drop(group.cell, chosen)), []).append(group)
    found = []
    for (planner, others), line in lines.items() if halves[1] else ():
        old, new = ([_select_seeds(group, half) for group in line] for half in halves)
        measured = [_measure(group, metric, threshold) for group in old]
        ranked = _rank(measured, metric)
        if threshold:
            ranked = [k for k in sorted(ranked) if threshold.check(np.array(measured[k].mean.value))]
        made = Choice(planner, others, len(line), *halves)
        if ranked and len(line) > 1:
            first, second = ranked[0], None if threshold else next(iter(ranked[1:]), None)
            made = made._replace(
                levels=_keep(line[first].cell, chosen),
                before=_measure(old[first], metric, threshold),
                after=_measure(new[first], metric, threshold),
            )
            if second is not None:
                (gap,) = differences(pair_differences(new[first], new[second], [metric]), [metric])
                made = made._replace(rival=_keep(line[second].cell, chosen), gap=gap)
        if len(line) > 1 and (ranked or threshold):
            found.append(made)
    return found


def _measure(group: Group, metric: Metric, threshold: Threshold | None) -> Measured:
    seeds = np.array([row.seed for row in group.done], dtype=object)
    values = average_by_map(group.table([metric]), seeds)
    ranges = [metric.most - metric.least]
    (mean,) = estimate_means(values, ranges)
    mean = mean.cut(metric.least, metric.most)
    finite = values[np.isfinite(values)]
    if threshold is None:
        return Measured(len(finite), mean)
    sure = np.nan
    if not np.isnan(mean.low):
        half = compute_p_values(values - threshold.value, ranges)[0] / 2
        sure = 1 - half if threshold.check(np.array(mean.value)) else half
    return Measured(len(finite), mean, int(threshold.check(finite).sum()), sure)


def _rank(measured: Sequence[Measured], metric: Metric) -> list[int]:
    """Indices from the best mean to the worst, of those with the most maps; none if neither direction is better.

    One with fewer maps may lack the hard ones.
    """
    sign, most = {"lower": 1.0, "higher": -1.0, "neither": np.nan}[metric.better], max(m.maps for m in measured)
    costs = [sign * m.mean.value if m.maps == most else np.nan for m in measured]
    return [k for k in np.argsort(costs, kind="stable").tolist() if np.isfinite(costs[k])]


def _compare_pairs(pairs: Collection[tuple[Group, Group]], metric: Metric) -> dict[tuple[Group, Group], Difference]:
    """Differences of pairs of groups, the first minus the second, with Holm's correction for all of them."""
    gaps = {pair: differences(pair_differences(*pair, [metric]), [metric])[0] for pair in pairs}
    tests = {frozenset(pair): gap.p_value for pair, gap in gaps.items() if gap.pairs}
    kept = dict(zip(tests, holm(list(tests.values())), strict=True))
    return {pair: replace(gap, survives=kept.get(frozenset(pair), False)) for pair, gap in gaps.items()}


def _select_seeds(group: Group, seeds: Collection[int]) -> Group:
    done, failed = (tuple(row for row in rows if row.seed in seeds) for rows in (group.done, group.failed))
    return replace(group, done=done, failed=failed)


def _drop(cell: Levels, factors: Collection[str]) -> Levels:
    return tuple(entry for entry in cell if entry[0] not in factors)


def _keep(cell: Levels, factors: Collection[str]) -> Levels:
    return tuple(entry for entry in cell if entry[0] in factors)
