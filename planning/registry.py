"""Registry of planners by name: built-in ones and those of other packages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points
from typing import Any


@dataclass(frozen=True)
class PlannerSpec:
    """A planner as text that another process can rebuild."""

    target: str  # "module:Class"
    options: Mapping[str, Any] = field(default_factory=dict)
    summary: str = ""
    upper_bound: bool = False  # knows what no UAV can know
    source: str = ""  # its package; empty: built in


def _composed(summary: str, **options: object) -> PlannerSpec:
    return PlannerSpec("planning.pieces:Composed", options, summary)


PLANNERS = {
    # Beyond the paper: visibility is expected over beliefs, and undetected people count (docs/explanation/planning.md).
    # Evaluations take longer here and in mcr, so there are fewer.
    "sma-nbo-mwtp": _composed(
        "SMA-NBO with the MWTP cost-to-go", search=0.1, visibility="expected", evaluations=10_240
    ),
    "sma-nbo": _composed("SMA-NBO, truncated at the horizon", beta=0.0),
    "pma-nbo": _composed("all UAVs decide at once (parallel), with MWTP", coordination="parallel"),
    "mcr": _composed(
        "sequential, on 50 trajectories by chance instead of the nominal",
        propagation="monte-carlo",
        beta=0.0,
        evaluations=10_240,
    ),
    "dec-pomdp": _composed(
        "each UAV plans for all, sends nothing, flies its share", coordination="decentralised", beta=0.0
    ),
    "centralized": _composed("one joint plan for all UAVs", coordination="centralised"),
    "lawnmower": PlannerSpec("planning.baselines:Lawnmower", {}, "each UAV mows a strip of the area, whatever it sees"),
    "greedy": PlannerSpec("planning.baselines:Greedy", {}, "each UAV to the most uncertain track within 40 m"),
    "hover": PlannerSpec("planning.baselines:Hover", {}, "no UAV moves"),
    "oracle": PlannerSpec("planning.oracle:Oracle", {}, "sees where people are and will be", upper_bound=True),
}
DEFAULT_PLANNER = "sma-nbo-mwtp"
COMPARED = ("sma-nbo-mwtp", "sma-nbo", "greedy", "hover")  # by default in a comparison
GROUP = "understory.planners"  # of entry points


@cache
def installed_planners() -> dict[str, PlannerSpec]:
    """Planners by name: built-in ones, then those of other packages; of one name the first."""
    found = dict(PLANNERS)
    for point in plugin_entry_points():
        found.setdefault(point.name, PlannerSpec(point.value, {}, source=package_of(point)))
    return found


def plugin_entry_points() -> list[EntryPoint]:
    """Entry points of planners of other packages, by name, usable or not."""
    try:
        points = list(entry_points(group=GROUP))
    except Exception:  # some package, ours or not, has metadata that cannot be read: take the others'
        points = [point for distribution in distributions() for point in _points(distribution)]
    return sorted(points, key=lambda point: (point.name, package_of(point)))


def _points(distribution: Distribution) -> list[EntryPoint]:
    try:
        return list(distribution.entry_points.select(group=GROUP))
    except Exception:  # as whatever wrote it may do anything
        return []


def package_of(point: EntryPoint) -> str:
    """Name and version of the package that an entry point belongs to."""
    return f"{point.dist.name} {point.dist.version}" if point.dist else point.value.partition(":")[0]
