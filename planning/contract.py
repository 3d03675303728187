"""Checks of a planner's interface, whatever its origin: `plan`, and optional `exchange`, `knowing` and `stateful`."""

from collections.abc import Callable
from typing import Any, cast

from planning.loading import ANY_PLANNER, checked_planner, load_planner
from planning.planner import Exchange, Planner
from tracking.errors import InputError
from tracking.numerics.arrays import Array
from tracking.plugins.plugin_error import Unusable

TruePositions = Callable[[float], Array]  # (M, 2) m of people at a time [s]; NaN while absent


def planner_of(given: object) -> Planner:
    """The planner that is given as text for `load_planner` or as an object; InputError if it is no planner."""
    if isinstance(given, str):
        return load_planner(given)
    if isinstance(given, type):
        raise InputError(f"planner: {given.__qualname__} is a class; give an object of it")
    return checked_planner(given, type(given).__qualname__)


def exchange_of(planner: object) -> Exchange:
    """The exchange of plans that a planner declares, else `Exchange()`; InputError if the declaration fails."""
    with ANY_PLANNER.errors(type(planner).__qualname__, "say what it sends", planner, "exchange"):
        exchange = getattr(planner, "exchange", None)  # a plug-in may declare anything
        # A copy, which the planner cannot change after this check.
        return Exchange(exchange.rounds, exchange.centre is True) if isinstance(exchange, Exchange) else Exchange()


def with_truth(planner: Planner | None, people: TruePositions) -> tuple[Planner | None, bool]:
    """The planner to fly, and True if it is an oracle, which its method `knowing` makes from the true positions.

    InputError if `knowing` fails.
    """
    with ANY_PLANNER.errors(
        type(planner).__qualname__, "be given the truth by its method `knowing`", planner, "knowing"
    ):
        knowing = getattr(planner, "knowing", None)
        if knowing is None:
            return planner, False
        informed = knowing(people)
        if not callable(getattr(informed, "plan", None)):
            raise Unusable("what it returns has no method plan(team, rng)")
    return cast("Planner", informed), True


def is_stateful(planner: object) -> bool:
    """True if a planner declares that it has a memory; InputError if it lacks `reset`, or if the declaration fails."""
    with ANY_PLANNER.errors(type(planner).__qualname__, "say what it remembers"):
        stateful = bool(getattr(planner, "stateful", False))
        if stateful and not callable(getattr(planner, "reset", None)):
            raise Unusable("it is stateful, but has no method reset(seed)")
    return stateful


def reset(planner: object, seed: int) -> None:
    """Reset a planner if it is stateful; InputError if that fails."""
    if is_stateful(planner):
        with ANY_PLANNER.errors(type(planner).__qualname__, "be reset"):
            cast("Any", planner).reset(seed)
