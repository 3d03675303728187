"""Between a planner that may fail and UAVs that must fly: checks plans, flies intents instead of faults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planning.optimizers import limited
from planning.planner import Plan, Planner, Situation
from tracking.compiled import Array
from tracking.matrices import length


@dataclass(frozen=True)
class Fault:
    """Something a planner or a detector did wrong, or the breakdown of a UAV, and to whose harm."""

    time: float  # s
    uav: int | None  # None: the whole team
    message: str


def decide(
    planner: Planner, team: Sequence[Situation], last: Mapping[int, Plan], rng: np.random.Generator
) -> tuple[list[Plan], list[Fault]]:
    """One valid plan per situation, whatever the planner does.

    A UAV without a valid plan flies on with the rest of its `last` plan, then hovers. Commands beyond the speed limit
    are shortened to it, and that is a fault too.
    """
    time = team[0].time
    try:
        proposed = list(planner.plan(team, rng))
        if len(proposed) != len(team):
            raise ValueError(f"{len(proposed)} plans for {len(team)} UAVs")
    except (Exception, SystemExit) as error:  # a stranger's code may raise anything
        fault = Fault(time, None, f"{type(error).__name__}: {error}")
        return [_shifted(last.get(s.own.id)) for s in team], [fault]
    plans, faults = [], []
    for situation, plan in zip(team, proposed, strict=True):
        own = situation.own
        problem = _problem(plan)
        if problem:
            plans.append(_shifted(last.get(own.id)))
        else:
            controls = np.array(plan.controls, dtype=float)
            fastest = length(controls).max()
            if fastest > own.max_speed * (1 + 1e-6):
                problem = f"speed {fastest:.3g} m/s exceeds {own.max_speed:g} m/s; clipped"
            plans.append(Plan(limited(controls[None], own.max_speed)[0], _others(plan)))
        if problem:
            faults.append(Fault(time, own.id, problem))
    return plans, faults


def _problem(plan: object) -> str:
    """What is wrong with a plan, or nothing."""
    others = getattr(plan, "others", {})
    if not isinstance(others, Mapping):
        return "others is no mapping"
    wrong = _wrong("controls", getattr(plan, "controls", None))
    return wrong or next(filter(None, (_wrong(f"others[{j!r}]", given) for j, given in others.items())), "")


def _wrong(name: str, given: object) -> str:
    """What is wrong with controls, or nothing."""
    try:
        controls = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        return f"{name} are not numbers"
    if controls.ndim != 2 or controls.shape[1] != 2 or len(controls) == 0:
        return f"{name} of shape {controls.shape}, not (H, 2)"
    if not np.all(np.isfinite(controls)):
        return f"{name} are not finite"
    return ""


def _others(plan: object) -> dict[int, Array]:
    """What a plan expects of others, if it says so."""
    return {j: np.array(given, dtype=float) for j, given in getattr(plan, "others", {}).items()}


def _shifted(plan: Plan | None) -> Plan:
    rest = np.zeros((0, 2)) if plan is None else plan.controls[1:]
    return Plan(rest if len(rest) else np.zeros((1, 2)))
