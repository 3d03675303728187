"""Choice of the metrics that a study's tables show."""

from collections.abc import Iterable, Sequence

from sim.facts.metrics.catalogue import METRICS, find_metric
from sim.facts.metrics.metric import Metric
from sim.study.trials import TrialRow
from tracking.errors import check_known

DEFAULT = tuple(name for name, known in METRICS.items() if known.compared)
RUNTIME = ("planning_cpu_s_per_decision", "planning_s_per_decision", "wall_s", "real_time_factor")


def find_shown_metric(name: str) -> Metric:
    """The metric with a row's name; if it is not in the registry, one with this label and no better direction.

    Names are never imported, because a store may come from any source.
    """
    if name in METRICS or ":" in name:
        return find_metric(name)
    unit = name[-1] if name.endswith(("_m", "_s")) else ""
    label = name.replace("_", " ").replace(".", ": ")
    return Metric(label, unit=unit, better="neither", digits=3, name=name)


def find_outside_metrics(asked: Iterable[str]) -> tuple[str, ...]:
    """The import strings among these metrics; InputError if a metric is not known and cannot be imported."""
    return tuple(name for name in dict.fromkeys(asked) if find_metric(name) and name not in METRICS)


def list_available(rows: Iterable[TrialRow]) -> list[str]:
    """All metrics of the rows: those of the registry in its order, then others by name."""
    names = {name for row in rows for name in row.metrics}
    return [name for name in METRICS if name in names] + sorted(names - set(METRICS))


def choose_metrics(rows: Sequence[TrialRow], asked: Sequence[str]) -> list[Metric]:
    """The metrics asked for, by default the usual ones; InputError if no row has one of them."""
    there = list_available(rows)
    for name in asked if there else ():
        check_known("--metric", name, there)
    usual = [name for name in DEFAULT if name in there] or there[:1] or DEFAULT[:1]
    return [find_shown_metric(name) for name in dict.fromkeys(asked or usual)]
