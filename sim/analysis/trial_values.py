"""Metrics of trials as arrays: by row, by flight, and as means over the repeats of a map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.analysis.cells import Group
from sim.evaluation.metric import Metric
from sim.study.row import Row
from tracking.numerics.arrays import Array

Flight = tuple[int, int]  # seed and repeat


def map_values(flights: Sequence[Flight], values: Array) -> Array:
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


def metric_values(rows: Sequence[Row], metrics: Sequence[Metric]) -> Array:
    """The metrics (rows, metrics); NaN where they are undefined."""
    table = [[row.metrics.get(metric.name, np.nan) for metric in metrics] for row in rows]
    return np.array(table, dtype=float).reshape(len(rows), len(metrics))


def flight_values(group: Group | None, metrics: Sequence[Metric]) -> dict[Flight, Array]:
    """The metrics of each flight; all NaN of one that failed."""
    if group is None:
        return {}
    failed = {(row.seed, row.repeat): undefined_values(metrics) for row in group.failed}
    lines = zip(group.done, metric_values(group.done, metrics), strict=True)
    return failed | {(row.seed, row.repeat): line for row, line in lines}


def undefined_values(metrics: Sequence[Metric]) -> Array:
    """A NaN for each metric."""
    return np.full(len(metrics), np.nan)
