"""Planners by name, or by import string."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
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


PLANNERS = {
    "sma-nbo-mwtp": PlannerSpec("planning.sma:SMA", {"cost_to_go": "mwtp"}, "SMA-NBO with the MWTP cost-to-go"),
    "sma-nbo": PlannerSpec("planning.sma:SMA", {"cost_to_go": "none"}, "SMA-NBO, truncated at the horizon"),
    "greedy": PlannerSpec("planning.baselines:Greedy", {}, "each UAV to the most uncertain track within 40 m"),
    "hover": PlannerSpec("planning.baselines:Hover", {}, "no UAV moves"),
}
DEFAULT_PLANNER = "sma-nbo-mwtp"


def load_planner(name: str) -> Planner:
    """The planner called `name`, or anyone's as "package.module:Class"; PlannerError says what is wrong."""
    if name in PLANNERS:
        spec = PLANNERS[name]
    elif ":" in name:
        spec = PlannerSpec(name)
    else:
        near = difflib.get_close_matches(name, PLANNERS, n=1, cutoff=0.3)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise PlannerError(
            f"planner: {name!r} is unknown; allowed are {', '.join(PLANNERS)}, or package.module:Class{hint}"
        )
    try:
        planner = _import(spec.target)(**spec.options)
    except TypeError as error:
        raise PlannerError(f"planner: {name!r} cannot be made: {error}") from error
    if not callable(getattr(planner, "plan", None)):
        raise PlannerError(f"planner: {name!r} has no method plan(team, rng)")
    return cast("Planner", planner)


def _import(target: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
    try:
        return imported(target)
    except ImportError as error:
        raise PlannerError(f"planner: {target!r} cannot be imported: {error}") from error
