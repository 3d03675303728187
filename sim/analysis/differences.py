"""Differences between a planner and a baseline, paired by map and repeat."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.analysis.cells import Group, Run
from sim.analysis.distributions import NO_SPREAD, Spread, spreads
from sim.analysis.intervals import LEVEL, Estimate, chances, maps_needed, means
from sim.evaluation.metric import Metric
from tracking.numerics.arrays import Array


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


@dataclass(frozen=True, eq=False)
class Pairs:
    """A group less the baseline, by run."""

    runs: tuple[Run, ...]  # of either
    values: Array  # (runs, metrics), NaN where one of both is missing, undefined or infinite

    def differences(self, metrics: Sequence[Metric], cells: int = 1) -> list[Difference]:
        """Metric by metric the mean, and how many maps went which way; where neither way is better, none is won."""
        gaps = map_values(self.runs, self.values)
        seeds = np.array([seed for seed, _ in self.runs], dtype=object)
        judged = zip(means(gaps), chances(gaps), spreads(self.values, seeds), maps_needed(gaps), strict=True)
        found = []
        for j, (mean, chance, spread, needed) in enumerate(judged):
            below, tied, above = (int(np.sum(np.sign(gaps[:, j]) == sign)) for sign in (-1, 0, 1))
            won, lost = {"lower": (below, above), "higher": (above, below), "neither": (0, 0)}[metrics[j].better]
            pairs = below + tied + above
            counts = pairs, len(gaps) - pairs, won, tied, lost, cells
            found.append(Difference(mean, *counts, chance=chance, spread=spread, needed=needed))
        return found


def map_values(runs: Sequence[Run], values: Array) -> Array:
    """Means (maps, metrics) over the repeats of each map that have a finite value; NaN where none has."""
    maps = list(dict.fromkeys(seed for seed, _ in runs))
    places = {seed: i for i, seed in enumerate(maps)}
    place = np.array([places[seed] for seed, _ in runs], dtype=np.int64)
    counted = np.isfinite(values)
    sums, counts = np.zeros((len(maps), values.shape[1])), np.zeros((len(maps), values.shape[1]))
    np.add.at(sums, place, np.where(counted, values, 0.0))
    np.add.at(counts, place, counted)
    found: Array = np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)
    return found


def paired(group: Group, base: Group | None, metrics: Sequence[Metric]) -> Pairs:
    """The metrics of the group less the baseline's, on every run of either."""
    ours, theirs = (g.by_run(metrics) if g else {} for g in (group, base))
    runs = tuple(sorted(ours.keys() | theirs.keys()))
    missing = np.full(len(metrics), np.nan)
    with np.errstate(invalid="ignore"):  # infinity less infinity
        gaps = np.array([ours.get(f, missing) - theirs.get(f, missing) for f in runs])
    gaps = gaps.reshape(len(runs), len(metrics))
    return Pairs(runs, np.where(np.isfinite(gaps), gaps, np.nan))


def map_points(groups: Sequence[Group], baseline: str, metric: Metric) -> dict[str, Array]:
    """Of each other planner the values (n, 2) on the maps that both flew, in the unit: the baseline's, then its own."""
    bases = {group.cell: group for group in groups if group.planner == baseline}
    found: dict[str, list[Array]] = {group.planner: [] for group in groups if group.planner != baseline}
    for group in groups:
        if group.planner != baseline:
            found[group.planner].append(metric.scale * _paired_values(group, bases.get(group.cell), metric))
    return {planner: np.concatenate(parts) for planner, parts in found.items()}


def _paired_values(group: Group, base: Group | None, metric: Metric) -> Array:
    """The baseline's and the group's values (n, 2) on the maps where both are finite in some repeat."""
    ours, theirs = (g.by_run([metric]) if g else {} for g in (group, base))
    runs = sorted(ours.keys() & theirs.keys())
    both = np.array([(theirs[f][0], ours[f][0]) for f in runs]).reshape(-1, 2)
    finite = np.isfinite(both).all(axis=1)
    return map_values([f for f, kept in zip(runs, finite, strict=True) if kept], both[finite])
