"""Copies and checks of the plans that planners of any origin return."""

from collections.abc import Iterable, Mapping

import numpy as np

from planning.planner import LONGEST_PLAN, Plan
from tracking.numerics.arrays import Array
from tracking.plugins.array_checks import check_numbers
from tracking.plugins.plugin_error import Unusable


def proposed_plans(plans: Iterable[object] | None, uavs: int) -> list[object]:
    """List of the plans that a planner returned; `Unusable` if their number is not that of the UAVs."""
    if plans is None:
        raise Unusable(f"None in place of plans for {uavs} UAVs")
    found = list(plans)
    if found and not uavs:
        raise Unusable("none are due between decisions")
    if len(found) != uavs:
        raise Unusable(f"{len(found)} plans for {uavs} UAVs")
    return found


def usable_plan(plan: object, *, finite: bool = True) -> Plan:
    """A copy of a plan; `Unusable` if it is no plan. Unless `finite` its own controls may be infinite or NaN."""
    if not hasattr(plan, "controls"):
        raise Unusable(f"it is no Plan but of type {type(plan).__name__}")
    return Plan(_controls("controls", plan.controls, finite=finite), _expected_of(plan))


def _expected_of(plan: object) -> dict[int, Array]:
    """Copies of the controls (H, 2) m/s that a plan expects of other UAVs; `Unusable` if any are no such controls."""
    others = getattr(plan, "others", {})
    if not isinstance(others, Mapping):
        raise Unusable("others is no mapping")
    return {j: _controls(f"others[{j!r}]", given) for j, given in others.items()}


def _controls(name: str, given: object, *, finite: bool = True) -> Array:
    """A copy of controls (H, 2) m/s; `Unusable` if they have another shape or, if they must be finite, are not."""
    controls = check_numbers(name, given)
    if controls.ndim != 2 or controls.shape[1] != 2 or not 1 <= len(controls) <= LONGEST_PLAN:
        raise Unusable(f"{name} of shape {controls.shape}, not (H, 2) with H from 1 to {LONGEST_PLAN}")
    if finite and not np.all(np.isfinite(controls)):
        raise Unusable(f"{name} are not finite")
    return controls
