"""Differences between a planner and a baseline, paired by map and repeat."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

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
)
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


NO_DIFFERENCE = Difference(NO_ESTIMATE, pairs=0, unpaired=0, won=0, tied=0, lost=0)


def differences(pairs: Mapping[Run, Array], metrics: Sequence[Metric], cells: int = 1) -> list[Difference]:
    """Differences by metric: mean, and numbers of maps won and lost, which are 0 if neither direction is better.

    pairs: as from `pair_differences`, or means of these over so many cells.
    """
    values = np.array([*pairs.values()]).reshape(len(pairs), len(metrics))
    maps = np.array([seed for seed, _ in pairs], dtype=object)
    gaps = average_by_map(values, maps)
    judged = zip(estimate_means(gaps), compute_p_values(gaps), count_maps_needed(gaps), strict=True)
    found = []
    for j, (metric, (mean, p_value, needed)) in enumerate(zip(metrics, judged, strict=True)):
        below, tied, above = (int(np.sum(np.sign(gaps[:, j]) == sign)) for sign in (-1, 0, 1))
        won, lost = {"lower": (below, above), "higher": (above, below), "neither": (0, 0)}[metric.better]
        paired_maps = below + tied + above
        counts = paired_maps, len(gaps) - paired_maps, won, tied, lost, cells
        widest = metric.most - metric.least  # largest possible difference
        mean = mean.cut(-widest, widest)
        found.append(Difference(mean, *counts, p_value=p_value, needed=needed))
    return found


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


def find_common_values(groups: Sequence[Group | None], metric: Metric) -> tuple[list[int], Array]:
    """Maps (n,) on which all groups have finite values in a common repeat, and these values (n, groups)."""
    tables = [group.list_by_run([metric]) if group else {} for group in groups]
    runs = sorted(set.intersection(*(set(table) for table in tables)))
    values = np.array([[table[run][0] for table in tables] for run in runs]).reshape(-1, len(groups))
    finite = np.isfinite(values).all(axis=1)
    maps = np.array([seed for seed, _ in runs], dtype=object)[finite]
    return np.unique(maps).tolist(), average_by_map(values[finite], maps)
