"""Errors of planners, each told in one line."""

from collections.abc import Iterator
from contextlib import contextmanager

from tracking.plugins.containment import ForeignError, contained
from tracking.plugins.registry import InputError


class PlannerError(InputError):
    """A planner that cannot be used; the message is one line."""


@contextmanager
def planner_errors(name: str, what: str, *passing: type[BaseException]) -> Iterator[None]:
    """Raises a PlannerError, "NAME cannot WHAT: why", for whatever a planner raises in the block."""
    try:
        with contained(*passing):
            yield
    except ForeignError as error:
        raise PlannerError(f"planner: {name!r} cannot {what}: {error.explained}") from error
