"""Verdict on a planner in one sentence."""

from __future__ import annotations

import math

from sim.analysis.differences import Difference
from sim.evaluation.metric import Metric


def verdict(planner: str, baseline: str, metric: Metric, gap: Difference, *, shown: int = 1) -> str:
    """One sentence that says whether a planner can be told from the baseline, and how.

    shown: how many differences the page shows, of which this is one.
    """
    if not gap.pairs:
        return f"{planner} and {baseline} cannot be told apart: they have no map in common."
    unit = " points" if metric.unit == "%" else f" {metric.unit}".rstrip()
    mean, low, high = (metric.text(v, signed=True) for v in (gap.mean.value, gap.mean.low, gap.mean.high))
    over = f", mean over {gap.cells} cells" if gap.cells > 1 else ""
    within = f" (95 %: {low} to {high}{over})" if gap.pairs > 1 else over
    counted = f"; of {gap.pairs} map{'s' * (gap.pairs > 1)} it won {gap.won}, tied {gap.tied} and lost {gap.lost}"
    ending = counted if metric.better != "neither" else ""
    apart = f"{planner} {_told(metric, gap)} {baseline}"
    start = apart if gap.told else f"{planner} and {baseline} cannot be told apart"
    return f"{start}: {metric.label} {mean}{unit}{within}{ending}. {_remark(gap, shown)}".strip()


def _remark(gap: Difference, shown: int) -> str:
    """Remark that a reader of a verdict needs."""
    if gap.told:
        lone = gap.survives or shown == 1
        return "" if lone else f"This does not survive Holm's correction for all {shown} differences."
    few = f"{gap.pairs} map{'s' * (gap.pairs > 1)} cannot tell any planners apart, six at least are needed. "
    needed = f"A difference as large takes some {gap.needed:.0f} maps." if math.isfinite(gap.needed) else ""
    return (few if gap.pairs < 6 else "") + needed


def _told(metric: Metric, gap: Difference) -> str:
    above = gap.mean.value > 0
    if metric.better == "neither":
        return "is above" if above else "is below"
    return "is better than" if above == (metric.better == "higher") else "is worse than"
