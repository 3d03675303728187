"""The trials of a study by cell and planner."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim.analysis.cell_text import Cell, cell_text, cells_of, natural, natural_cell
from sim.analysis.planner_labels import baseline_of, entrant, planner_labels
from sim.evaluation.metric import Metric
from sim.scenario.random_streams import numbered
from sim.study.tasks import Row
from tracking.numerics.arrays import Array

Flight = tuple[int, int]  # seed and repeat
_NOTHING: Mapping[str, str] = {}


@dataclass(frozen=True, eq=False)
class Group:
    """All trials of one planner in one cell, by seed and repeat."""

    cell: Cell
    planner: str  # without the options that vary with the cell
    done: tuple[Row, ...]
    failed: tuple[Row, ...]

    def values(self, metric: str) -> Array:
        """The metric of each trial done (n,); NaN where it is undefined."""
        return np.array([row.metrics.get(metric, np.nan) for row in self.done], dtype=float)

    @property
    def flights(self) -> list[Flight]:
        """Seed and repeat of each trial done (n,)."""
        return [(row.seed, row.repeat) for row in self.done]

    def table(self, metrics: Sequence[Metric]) -> Array:
        """The metrics of each trial done (n, metrics); NaN where they are undefined."""
        return np.array([self.values(metric.name) for metric in metrics]).reshape(len(metrics), len(self.done)).T

    def by_flight(self, metrics: Sequence[Metric]) -> dict[Flight, Array]:
        """The metrics of each flight; all NaN of one that failed."""
        failed = {(row.seed, row.repeat): np.full(len(metrics), np.nan) for row in self.failed}
        return failed | dict(zip(self.flights, self.table(metrics), strict=True))

    @property
    def ospa(self) -> Array:
        """OSPA of all scans of all trials together (N,) m."""
        return np.concatenate([np.zeros(0), *(row.ospa for row in self.done)])

    @property
    def curves(self) -> tuple[Array, Array]:
        """Times (T,) s and OSPA (n, T) m of each trial; a mission that is shorter than the longest ends in NaN."""
        times = max((row.times for row in self.done), key=len, default=np.zeros(0))
        found = np.full((len(self.done), len(times)), np.nan)
        for curve, row in zip(found, self.done, strict=True):
            curve[: len(row.ospa)] = row.ospa
        return times, found


def grouped(rows: Sequence[Row], baseline: str | None = None, given: Mapping[str, str] = _NOTHING) -> list[Group]:
    """Every cell's groups, the baseline's first; cells and other planners in natural order, however rows are ordered.

    A planner that varies with the cell, such as sma-nbo(horizon=3) where H = 3, goes by what its texts share.
    given: labels of planners, as from `labels_of`. ValueError where a trial is there twice.
    """
    cells = cells_of(rows)
    labels = planner_labels(rows, cells, given)
    first = None if baseline is None else baseline_of(rows, baseline, given)
    found: dict[tuple[Cell, str], dict[tuple[int, int], Row]] = defaultdict(dict)
    for row, cell in zip(rows, cells, strict=True):
        group = found[cell, labels[entrant(row)]]
        flight = row.seed, row.repeat
        if flight in group:
            place = f" in {cell_text(cell)}" if cell else ""
            raise ValueError(f"{entrant(row)}, {numbered(*flight)} is there twice{place}")
        group[flight] = row
    order = sorted(found, key=lambda key: (natural_cell(key[0]), key[1] != first, natural(key[1])))
    return [_group(*key, found[key]) for key in order]


def _group(cell: Cell, planner: str, rows: dict[tuple[int, int], Row]) -> Group:
    ordered = [rows[flight] for flight in sorted(rows)]
    parts = (tuple(row for row in ordered if (row.status == "done") == wanted) for wanted in (True, False))
    return Group(cell, planner, *parts)


def varying(groups: Sequence[Group]) -> dict[str, list[str]]:
    """The factors that take several values over the groups, and these in order."""
    values: dict[str, dict[str, None]] = defaultdict(dict)
    for group in groups:
        for name, value in group.cell:
            values[name][value] = None
    return {name: sorted(found, key=natural) for name, found in values.items() if len(found) > 1}


def constant(groups: Sequence[Group]) -> Cell:
    """The factors that have the same value in all groups."""
    changing = varying(groups)
    return tuple((name, value) for name, value in groups[0].cell if name not in changing)


def trimmed(groups: Sequence[Group]) -> list[Group]:
    """The groups, their cells without the factors that are the same everywhere."""
    same = constant(groups)
    return [replace(g, cell=tuple(factor for factor in g.cell if factor not in same)) for g in groups]
