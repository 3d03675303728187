"""Planners by name, with options, or by import string."""

from __future__ import annotations

import ast
import inspect
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from importlib.machinery import PathFinder
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points
from typing import TYPE_CHECKING, Any, cast

from tracking.plugins.containment import ForeignError, Unusable, contained
from tracking.plugins.importing import imported, nearest

if TYPE_CHECKING:  # naming planners needs none of their code
    from planning.planner import Planner
    from tracking.numerics.compiled import Array

    Whereabouts = Callable[[float], Array]


class PlannerError(ValueError):
    """What was asked for is no planner; the message is one line."""


@dataclass(frozen=True)
class PlannerSpec:
    """A planner as text that another process can rebuild."""

    target: str  # "module:Class"
    options: Mapping[str, Any] = field(default_factory=dict)
    summary: str = ""
    upper_bound: bool = False  # knows what no UAV can know
    source: str = ""  # the package that brings it; empty: ours


def _composed(summary: str, **options: object) -> PlannerSpec:
    return PlannerSpec("planning.pieces:Composed", options, summary)


PLANNERS = {
    # Beyond the paper (docs/explanation/planning.md): what UAVs would see is expected over beliefs; search counts.
    # Where an evaluation is dearer, as here and in mcr, there are fewer, so that decisions keep their time.
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
COMPARED = ("sma-nbo-mwtp", "sma-nbo", "greedy", "hover")  # where a comparison is not told what to compare
GROUP = "understory.planners"  # of entry points


@cache
def installed() -> dict[str, PlannerSpec]:
    """Every planner that has a name here: ours, then those that other packages bring, of one name the first."""
    found = dict(PLANNERS)
    for point in brought():
        found.setdefault(point.name, PlannerSpec(point.value, {}, source=origin(point)))
    return found


def brought() -> list[EntryPoint]:
    """The planners of other packages, by name, whether they can be used or not."""
    try:
        points = list(entry_points(group=GROUP))
    except Exception:  # some package, ours or not, has metadata that cannot be read: take the others'
        points = [point for distribution in distributions() for point in _points(distribution)]
    return sorted(points, key=lambda point: (point.name, origin(point)))


def _points(distribution: Distribution) -> list[EntryPoint]:
    try:
        return list(distribution.entry_points.select(group=GROUP))
    except Exception:  # as whatever wrote it may do anything
        return []


def origin(point: EntryPoint) -> str:
    """Name and version of the package that brings a planner."""
    return f"{point.dist.name} {point.dist.version}" if point.dist else point.value.partition(":")[0]


def load_planner(text: str) -> Planner:
    """The planner called "name" or "name(option=value, ...)", or anyone's as "package.module:Class", options likewise.

    PlannerError says what is wrong.
    """
    name, options = _parsed(text)
    spec = _spec(name)
    make = _import(name, spec)
    with contained_as(name, "be made", PlannerError):
        _check(name, make, options)
        planner = make(**{**spec.options, **options})
        plan = getattr(planner, "plan", None)
        if not callable(plan):
            raise PlannerError(
                f"planner: {name!r} has no method plan(team, rng){nearest('plan', _methods(planner), cutoff=0.6)}"
            )
        if not _takes_two(plan):
            raise PlannerError(f"planner: plan of {name!r} takes {inspect.signature(plan)}; it must take (team, rng)")
    return cast("Planner", planner)


def is_ours(text: str) -> bool:
    """Whether a planner's code comes with this package; PlannerError where there is no planner of that name."""
    return _spec(_parsed(text)[0]).target.partition(".")[0] == __package__


def told(planner: Planner, people: Whereabouts) -> tuple[Planner, bool]:
    """The planner to fly, an oracle's being that which is told where people are, and whether it is such a one.

    PlannerError where it fails to say.
    """
    with contained_as(type(planner).__qualname__, "be given the truth by its method `knowing`"):
        knowing = getattr(planner, "knowing", None)
        if knowing is None:
            return planner, False
        seer = knowing(people)
        if not callable(getattr(seer, "plan", None)):
            raise Unusable("what it returns has no method plan(team, rng)")
    return cast("Planner", seer), True


@contextmanager
def contained_as(name: str, what: str, *passing: type[BaseException]) -> Iterator[None]:
    """Raises a PlannerError, "NAME cannot WHAT: why", for whatever a planner raises in the block."""
    try:
        with contained(*passing):
            yield
    except ForeignError as error:
        raise PlannerError(f"planner: {name!r} cannot {what}: {error.explained}") from error


def _methods(planner: object) -> list[str]:
    return [name for name in dir(planner) if not name.startswith("_") and callable(getattr(planner, name, None))]


def _takes_two(plan: Any) -> bool:  # noqa: ANN401 - whatever a user's class holds
    try:
        inspect.signature(plan).bind(None, None)
    except TypeError:
        return False
    except ValueError:
        return True  # written in C, say: calling it will tell
    return True


def _spec(name: str) -> PlannerSpec:
    if name in installed():
        return installed()[name]
    if ":" in name:
        return PlannerSpec(name)
    allowed = f"allowed are {', '.join(installed())}, or package.module:Class"
    raise PlannerError(f"planner: {name!r} is unknown; {allowed}{_meant(name)}")


def _meant(name: str) -> str:
    """The nearest valid name of a planner; for a module or a class in it, how to write that."""
    module, _, last = name.rpartition(".")
    if module and last[:1].isupper():
        return f"; did you mean {module}:{last}?"
    near = nearest(name, installed(), cutoff=0.6)
    if not near and (module or (name.isidentifier() and PathFinder.find_spec(name))):
        return f"; did you mean {name}:Class?"
    return near or nearest(name, installed())


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
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what is no good Python need be none
            return ast.literal_eval(text)
    except (ValueError, SyntaxError, RecursionError, MemoryError):  # the last of brackets by the hundred
        return text


def _check(name: str, make: Any, options: Mapping[str, Any]) -> None:  # noqa: ANN401 - whatever a user's module holds
    """PlannerError if there is an option that the planner does not have, or of another kind than its default."""
    try:
        parameters = inspect.signature(make).parameters
    except (TypeError, ValueError):
        return  # written in C, say: making it will tell
    if any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
        return
    for option, value in options.items():
        if option not in parameters:
            allowed = f"allowed are {', '.join(parameters)}" if parameters else "it has none"
            raise PlannerError(f"planner: {name!r} has no option {option!r}; {allowed}{nearest(option, parameters)}")
        kind = _kind(parameters[option].default)
        if kind and kind != _kind(value):
            raise PlannerError(f"planner: option {option} of {name!r} must be {kind}, is {value!r}")


def _kind(value: object) -> str:
    """What a default asks for; empty: anything."""
    if isinstance(value, bool):
        return "True or False"
    if isinstance(value, int | float):
        return "a number"
    return "a word" if isinstance(value, str) else ""


def _import(name: str, spec: PlannerSpec) -> Any:  # noqa: ANN401 - whatever a user's module holds
    try:
        return imported(spec.target)
    except ImportError as error:
        what = f"{name!r} of {spec.source}, {spec.target!r}," if spec.source else repr(spec.target)
        raise PlannerError(f"planner: {what} cannot be imported: {error}") from error
