"""Planners by name, with options, or by import string."""

from __future__ import annotations

import ast
import difflib
import inspect
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, cast

from tracking.plugin import imported

if TYPE_CHECKING:  # naming planners needs none of their code
    from planning.planner import Planner


class PlannerError(ValueError):
    """What was asked for is no planner; the message is one line."""


@dataclass(frozen=True)
class PlannerSpec:
    """A planner as text that another process can rebuild."""

    target: str  # "module:Class"
    options: Mapping[str, Any] = field(default_factory=dict)
    summary: str = ""


def _composed(summary: str, **options: object) -> PlannerSpec:
    return PlannerSpec("planning.pieces:Composed", options, summary)


PLANNERS = {
    "sma-nbo-mwtp": _composed("SMA-NBO with the MWTP cost-to-go", search=0.1),
    "sma-nbo": _composed("SMA-NBO, truncated at the horizon", beta=0.0),
    "pma-nbo": _composed("all UAVs decide at once (parallel), with MWTP", coordination="parallel"),
    "mcr": _composed(
        "sequential, on 50 trajectories by chance instead of the nominal", propagation="monte-carlo", beta=0.0
    ),
    "dec-pomdp": _composed("each UAV plans for all, sends nothing, flies its share", coordination="decentralised"),
    "centralized": _composed("one joint plan for all UAVs", coordination="centralised"),
    "lawnmower": PlannerSpec("planning.baselines:Lawnmower", {}, "each UAV mows a strip of the area, whatever it sees"),
    "greedy": PlannerSpec("planning.baselines:Greedy", {}, "each UAV to the most uncertain track within 40 m"),
    "hover": PlannerSpec("planning.baselines:Hover", {}, "no UAV moves"),
}
DEFAULT_PLANNER = "sma-nbo-mwtp"
COMPARED = ("sma-nbo-mwtp", "sma-nbo", "greedy", "hover")  # where a comparison is not told what to compare
GROUP = "understory.planners"  # of entry points


@cache
def installed() -> dict[str, PlannerSpec]:
    """Every planner that has a name here: ours, then those that other packages bring."""
    others = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return PLANNERS | {
        p.name: PlannerSpec(p.value, {}, f"from {p.dist.name if p.dist else p.module}")
        for p in others
        if p.name not in PLANNERS
    }


def load_planner(text: str) -> Planner:
    """The planner called "name" or "name(option=value, ...)", or anyone's as "package.module:Class", options likewise.

    PlannerError says what is wrong.
    """
    name, options = _parsed(text)
    spec = _spec(name)
    make = _import(spec.target)
    _check(name, make, options)
    try:
        planner = make(**{**spec.options, **options})
    except (TypeError, ValueError) as error:
        if isinstance(error, ValueError) and not options:
            raise  # the planner's own fault, not that of what was asked for
        raise PlannerError(f"planner: {name!r} cannot be made: {error}") from error
    if not callable(getattr(planner, "plan", None)):
        raise PlannerError(f"planner: {name!r} has no method plan(team, rng)")
    return cast("Planner", planner)


def _spec(name: str) -> PlannerSpec:
    if name in installed():
        return installed()[name]
    if ":" in name:
        return PlannerSpec(name)
    allowed = f"allowed are {', '.join(installed())}, or package.module:Class"
    raise PlannerError(f"planner: {name!r} is unknown; {allowed}{_hint(name, installed())}")


def _parsed(text: str) -> tuple[str, dict[str, Any]]:
    """Name and options of "name(option=value, ...)"; values are Python literals or bare words."""
    name, bracket, rest = text.strip().partition("(")
    if not bracket:
        return name, {}
    options: dict[str, Any] = {}
    for item in filter(None, (part.strip() for part in rest.removesuffix(")").split(","))):
        key, equals, value = (part.strip() for part in item.partition("="))
        if not rest.endswith(")") or not equals or not key.isidentifier() or not value or key in options:
            raise PlannerError(f"planner: {text!r} is not of the form name(option=value, ...)")
        options[key] = _value(value)
    if not rest.endswith(")"):
        raise PlannerError(f"planner: {text!r} is not of the form name(option=value, ...)")
    return name, options


def _value(text: str) -> Any:  # noqa: ANN401 - any literal
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text


def _check(name: str, make: Any, options: Collection[str]) -> None:  # noqa: ANN401 - whatever a user's module holds
    """PlannerError if there is an option that the planner does not have."""
    try:
        parameters = inspect.signature(make).parameters
    except (TypeError, ValueError):
        return  # written in C, say: making it will tell
    if any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
        return
    for option in options:
        if option not in parameters:
            allowed = f"allowed are {', '.join(parameters)}" if parameters else "it has none"
            raise PlannerError(f"planner: {name!r} has no option {option!r}; {allowed}{_hint(option, parameters)}")


def _hint(name: str, known: Collection[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.3)
    return f"; did you mean {near[0]}?" if near else ""


def _import(target: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
    try:
        return imported(target)
    except ImportError as error:
        raise PlannerError(f"planner: {target!r} cannot be imported: {error}") from error
