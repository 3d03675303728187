"""The trials of a study by cell and planner."""

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from sim.facts.metrics.metric import Metric
from sim.scenario.random_streams import format_seed
from sim.study.analysis.labels import append_cell, cell_text, cells_of, format_entrant, label_planners
from sim.study.cells import Levels
from sim.study.trials import TrialRow
from tracking.errors import InputError
from tracking.numerics.arrays import Array


class Run(NamedTuple):
    """What a trial flew."""

    seed: int
    repeat: int


class Curves(NamedTuple):
    """OSPA over time; NaN after the end of missions shorter than the longest."""

    times: Array  # (T,) s
    ospa: Array  # (n, T) m, of each trial


@dataclass(frozen=True, eq=False)
class Group:
    """All trials of one planner in one cell, by seed and repeat."""

    cell: Levels
    planner: str  # label without the options that vary with the cell
    done: tuple[TrialRow, ...]
    failed: tuple[TrialRow, ...]

    @property
    def title(self) -> str:
        """Planner and cell."""
        return append_cell(self.planner, self.cell)

    @property
    def sample(self) -> str:
        """What each seed counts as: a map, or if several have the same trees and people, as from files, a flight.

        It remains a seed if it has several flights.
        """
        worlds = {row.seed: row.metrics["world"] for row in self.done if "world" in row.metrics}
        if len(set(worlds.values())) == len(worlds):
            return "map"
        rows = (*self.done, *self.failed)
        return "flight" if len({row.seed for row in rows}) == len(rows) else "seed"

    def values(self, metric: str) -> Array:
        """The metric of each trial done (n,); NaN if it is undefined."""
        return np.array([row.metrics.get(metric, np.nan) for row in self.done], dtype=float)

    def table(self, metrics: Sequence[Metric]) -> Array:
        """The metrics of each trial done (n, metrics); NaN if they are undefined."""
        return np.array([self.values(metric.name) for metric in metrics]).reshape(len(metrics), len(self.done)).T

    def list_by_run(self, metrics: Sequence[Metric]) -> dict[Run, Array]:
        """The metrics of each run; all NaN if it failed."""
        failed = {Run(row.seed, row.repeat): np.full(len(metrics), np.nan) for row in self.failed}
        return failed | {
            Run(row.seed, row.repeat): own for row, own in zip(self.done, self.table(metrics), strict=True)
        }

    def pool_ospa(self) -> Array:
        """OSPA (N,) m of all scans of all trials together."""
        return np.concatenate([np.zeros(0), *(row.ospa for row in self.done)])

    def curves(self) -> Curves:
        """OSPA of each trial over time."""
        times = max((row.times for row in self.done), key=len, default=np.zeros(0))
        found = np.full((len(self.done), len(times)), np.nan)
        for curve, row in zip(found, self.done, strict=True):
            curve[: len(row.ospa)] = row.ospa
        return Curves(times, found)


def group_rows(
    rows: Sequence[TrialRow],
    baseline: str | None = None,
    given: Mapping[str, str] = {},
    order: Sequence[str] = (),
    levels: Mapping[str, Sequence[str]] = {},
) -> list[Group]:
    """Groups of rows by cell and planner; what neither `order` nor `levels` lists is in natural order.

    baseline: its label, as from `find_baseline`, which comes first of these. given: labels of planners, as from
    `parse_labels`. order: entrants, as from `format_entrant`, in the order of their planners. levels: levels of factors
    in their order. A planner whose options vary with the cell, such as sma-nbo(horizon=3) where H = 3, is labelled by
    the text that all its cells share.
    InputError if a trial is there twice, as from a folder in which a study was flown with different settings.
    """
    cells = cells_of(rows)
    labels = label_planners(rows, given)
    found: dict[tuple[Levels, str], dict[Run, TrialRow]] = defaultdict(dict)
    for row, cell in zip(rows, cells, strict=True):
        group = found[cell, labels[format_entrant(row)]]
        run = Run(row.seed, row.repeat)
        if run in group:
            place = f" in {cell_text(cell)}" if cell else ""
            text = f"{format_entrant(row)}, {format_seed(*run)} is there twice{place}"
            raise InputError(f"study: {text}; flights with other settings or other code need a folder of their own")
        group[run] = row

    places = {labels[text]: -i for i, text in enumerate(reversed(order)) if text in labels}

    def rank(key: tuple[Levels, str]) -> tuple[Any, ...]:
        cell, planner = key
        own = places.get(planner, 1), planner != baseline, _make_sort_key(planner)
        return [(name, _rank_level(name, value, levels)) for name, value in cell], *own

    groups = []
    for cell, planner in sorted(found, key=rank):
        own = [row for _, row in sorted(found[cell, planner].items())]
        done = tuple(row for row in own if row.status == "done")
        groups.append(Group(cell, planner, done, tuple(row for row in own if row.status != "done")))
    return groups


def find_varying_factors(groups: Sequence[Group], levels: Mapping[str, Sequence[str]] = {}) -> dict[str, list[str]]:
    """The factors with several values over the groups, with these values in the order of `group_rows`."""
    values: dict[str, dict[str, None]] = defaultdict(dict)
    for group in groups:
        for name, value in group.cell:
            values[name][value] = None
    return {
        name: sorted(found, key=lambda value: _rank_level(name, value, levels))
        for name, found in values.items()
        if len(found) > 1
    }


def find_constant_factors(groups: Sequence[Group]) -> Levels:
    """The factors that have the same value in all groups."""
    return tuple(factor for factor in groups[0].cell if all(factor in group.cell for group in groups))


def drop_constant_factors(groups: Sequence[Group]) -> list[Group]:
    """The groups, without the factors that have the same value in all of them."""
    same = find_constant_factors(groups)
    return [replace(g, cell=tuple(factor for factor in g.cell if factor not in same)) for g in groups]


def _rank_level(factor: str, level: str, levels: Mapping[str, Sequence[str]]) -> tuple[Any, ...]:
    """Sort key of a level: its place in the list of its factor, else its natural order after these."""
    listed = levels.get(factor, ())
    return (listed.index(level), ()) if level in listed else (len(listed), _make_sort_key(level))


def _make_sort_key(text: str) -> tuple[tuple[int, float, str], ...]:
    """Sort key that puts 5 before 15 and numbers before words."""
    parts = re.findall(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|[^\d]+", text)
    return tuple((0, float(p), "") if re.fullmatch(r"[-+]?\d.*", p) else (1, 0.0, p) for p in parts)
