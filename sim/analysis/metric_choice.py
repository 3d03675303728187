"""Choice of the metrics that a study's tables show."""

from collections.abc import Iterable, Sequence

from sim.evaluation.metric import METRICS, Metric, metric
from sim.study.tasks import Row
from tracking.plugins.registry import check_known

DEFAULT = ("ospa.share_under_1m", "ospa.mean_m", "ospa.median_m")
DECISION = ("planning_cpu_s_per_decision", "planning_s_per_decision")  # the first that a study has is drawn
RUNTIME = (*DECISION, "wall_s", "real_time_factor")


def metric_shown(name: str) -> Metric:
    """The metric of a row; of one that is not in the registry, what its name tells, and no way of it is better.

    Nothing is imported for a name, as a store may come from any source.
    """
    if name in METRICS or ":" in name:
        return metric(name)
    unit = name[-1] if name.endswith(("_m", "_s")) else ""
    label = name.replace("_", " ").replace(".", ": ")
    return Metric(label, unit=unit, better="neither", digits=3, name=name)


def from_outside(asked: Iterable[str]) -> tuple[str, ...]:
    """Those asked for that are import strings; InputError where a metric is neither known nor can be imported."""
    return tuple(name for name in dict.fromkeys(asked) if metric(name) and name not in METRICS)


def available(rows: Iterable[Row]) -> list[str]:
    """All metrics that any of the rows has: those of the registry in its order, then the others by name."""
    names = {name for row in rows for name in row.metrics}
    return [name for name in METRICS if name in names] + sorted(names - set(METRICS))


def chosen(rows: Sequence[Row], asked: Sequence[str]) -> list[Metric]:
    """The metrics asked for, or else the usual ones; InputError where no row has one."""
    there = available(rows)
    for name in asked if there else ():
        check_known("--metric", name, there)
    usual = [name for name in DEFAULT if name in there] or there[:1] or DEFAULT[:1]
    return [metric_shown(name) for name in dict.fromkeys(asked or usual)]
