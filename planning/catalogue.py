"""Planners by name, built-in ones and planners of other packages, and a catalogue of them for display."""

import inspect
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from tracking.plugins.registry import import_plugin


@dataclass(frozen=True)
class PlannerSpec:
    """A planner as text that another process can rebuild."""

    target: str  # "module:Class"
    options: Mapping[str, Any] = field(default_factory=dict)
    summary: str = ""
    upper_bound: bool = False  # True for an oracle, which knows what no UAV can know
    source: str = ""  # package that the planner is from; empty: built in


def _compose(summary: str, **options: object) -> PlannerSpec:
    return PlannerSpec("planning.composed:Composed", options, summary)


# Options of the rivals that maximise mutual information.
_INFORMATIVE: dict[str, Any] = {
    "coordination": "partitions",
    "beta": 0.0,
    "uncertainty": "information",
    "visibility": "expected",
    "evaluations": 8_192,
    "search": 0.5,
}

# Beyond the paper: visibility is expected over beliefs, and undetected people count (docs/explanation/planning.md).
# There are fewer evaluations with these options and in mcr, because each takes longer.
_EXPECTED: dict[str, Any] = {"search": 0.1, "visibility": "expected", "evaluations": 9_216}
# Errors are cut off at GOSPA's usual distance c, a UAV out of touch costs c² a step, and tracks have no cost-to-go
# (docs/explanation/planning.md says why).
_GOSPA: dict[str, Any] = {"cutoff": 10.0, "beta": 0.0, "connectivity": 100.0}

PLANNERS = {
    "sma-nbo-gospa": _compose("SMA-NBO on squared errors up to a cut-off, as in GOSPA", **_GOSPA, **_EXPECTED),
    "sma-nbo-mwtp": _compose("SMA-NBO with the MWTP cost-to-go", **_EXPECTED),
    "sma-nbo": _compose("SMA-NBO, truncated at the horizon", beta=0.0),
    "pma-nbo": _compose("all UAVs decide at once (parallel), with MWTP", coordination="parallel"),
    "mcr": _compose(
        "sequential, on 50 sampled trajectories instead of the nominal",
        propagation="monte-carlo",
        beta=0.0,
        evaluations=10_240,
    ),
    "dec-pomdp": _compose(
        "each UAV plans for all, flies its share, sends nothing", coordination="decentralised", beta=0.0
    ),
    "centralized": _compose("one joint plan for all UAVs", coordination="centralised"),
    "greedy-mi": _compose("each UAV in turn adds the most mutual information", **_INFORMATIVE),
    "rsp": _compose("as greedy-mi, in two rounds that UAVs draw (RSP)", rounds=2, **_INFORMATIVE),
    "dec-mcts": PlannerSpec("planning.rivals.dec_mcts:DecMCTS", {}, "each UAV searches a tree, sends likely sequences"),
    "thompson": PlannerSpec("planning.rivals.thompson:Thompson", {}, "each UAV draws a world and flies to its errors"),
    "lawnmower": PlannerSpec("planning.baselines:Lawnmower", {}, "each UAV sweeps a strip, whatever it sees"),
    "greedy": PlannerSpec("planning.baselines:Greedy", {}, "each UAV flies to its most uncertain track within 40 m"),
    "random": PlannerSpec("planning.baselines:Random", {}, "each UAV flies at a random velocity"),
    "hover": PlannerSpec("planning.baselines:Hover", {}, "no UAV moves"),
    "oracle-found": PlannerSpec(
        "planning.oracle:FoundOracle",
        {**_GOSPA, **_EXPECTED},
        "knows where the people are who have been found",
        upper_bound=True,
    ),
    "oracle": PlannerSpec("planning.oracle:Oracle", _GOSPA, "knows where people are and will be", upper_bound=True),
}
DEFAULT_PLANNER = "sma-nbo-gospa"
COMPARED = ("sma-nbo-gospa", "sma-nbo", "greedy", "hover")  # by default in a comparison
GROUP = "understory.planners"  # of entry points


@cache
def find_planners() -> dict[str, PlannerSpec]:
    """Planners by name: built-in ones, then planners of installed packages; the first of a name counts."""
    found = dict(PLANNERS)
    for point in _find_entry_points():
        found.setdefault(point.name, PlannerSpec(point.value, {}, source=_find_package(point)))
    return found


def import_planner(spec: PlannerSpec) -> Any:  # noqa: ANN401 - whatever a user's module holds
    """The class or function that makes a planner; ImportError if there is none.

    Only planners that are not built in may be in the current folder, which may have a `planning` of its own.
    """
    built_in = spec in PLANNERS.values()
    return pkgutil.resolve_name(spec.target) if built_in else import_plugin(spec.target)


def _find_entry_points() -> list[EntryPoint]:
    """Entry points of planners of other packages, by name, usable or not."""
    return sorted(entry_points(group=GROUP), key=lambda point: (point.name, _find_package(point)))


def _find_package(point: EntryPoint) -> str:
    """Name and version of the package that an entry point belongs to."""
    return f"{point.dist.name} {point.dist.version}" if point.dist else point.value.partition(":")[0]


def list_planners() -> dict[str, dict[str, str]]:
    """Descriptions of the planners by package, and their options under a last heading."""
    ours: dict[str, str] = {}
    groups = {"Built in": ours}
    for name, spec in PLANNERS.items():
        marks = ["default"] * (name == DEFAULT_PLANNER) + ["upper bound: knows what no UAV can"] * spec.upper_bound
        ours[name] = " ".join([spec.summary, *(f"({mark})" for mark in marks)])
    options = _list_built_in_options()
    for point in _find_entry_points():
        theirs = groups.setdefault(f"From {_find_package(point)}", {})
        spec = find_planners()[point.name]
        if spec.target != point.value or spec.source != _find_package(point):
            owner = f"of {spec.source}" if spec.source else "built in"
            theirs[point.name] = f"hidden: the name is that of a planner {owner}"
            continue
        try:
            made = import_plugin(point.value)
        except ImportError as error:
            theirs[point.name] = f"cannot be used: {error}"
            continue
        theirs[point.name] = (inspect.getdoc(made) or "").partition("\n")[0]
        options[point.name] = _join(_read_defaults(made))
    shown = {name: text for name, text in options.items() if text}
    return groups | {"Options, each with what it is if not given": shown}


def _list_built_in_options() -> dict[str, str]:
    """Options of the built-in planners; for a class that was listed before, only those that differ."""
    first: dict[str, str] = {}
    options: dict[str, dict[str, Any]] = {}
    found: dict[str, str] = {}
    for name, spec in PLANNERS.items():
        like = first.setdefault(spec.target, name)
        options[name] = _read_defaults(import_planner(spec)) | dict(spec.options)
        if like == name:
            found[name] = _join(options[name])
        else:
            other = {option: value for option, value in options[name].items() if value != options[like][option]}
            found[name] = f"those of {like}, with {_join(other)}" if other else f"those of {like}"
    return found


def _read_defaults(make: Any) -> dict[str, Any]:  # noqa: ANN401 - whatever a module holds
    """Options of the class or function that makes a planner, with their defaults."""
    return {p.name: p.default for p in (list_parameters(make) or {}).values() if p.default is not p.empty}


def list_parameters(make: Any) -> Mapping[str, inspect.Parameter] | None:  # noqa: ANN401 - whatever a module holds
    """Parameters of the class or function that makes a planner; None if unknown, as for one that is written in C."""
    try:
        return inspect.signature(make).parameters
    except (TypeError, ValueError):
        return None


def _join(options: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={value if str(value) else repr(value)}" for name, value in options.items())
