"""A study of values given in Python."""

from collections.abc import Iterable, Mapping
from typing import Any

from sim.scenario.quantities import REPEATS, integer
from sim.study.settings_text import overrides
from sim.study.study import Study, adapted
from tracking.plugins.registry import InputError


def study_of(
    planners: object, scenarios: object, *, seeds: Iterable[int], repeats: int, settings: Mapping[str, Any] | None
) -> Study:
    """A comparison of one or several planners in one or several scenarios; InputError where something is wrong."""
    if isinstance(seeds, str) or not isinstance(seeds, Iterable):
        raise InputError(f"seeds: {seeds!r} is not allowed; expected several integers, such as range(10)")
    return adapted(
        Study("compare", _several("planners", planners), scenarios=_several("scenarios", scenarios)),
        seeds=",".join(map(str, seeds)),
        repeats=integer(repeats, "repeats", least=1, most=REPEATS),
        overrides=overrides(settings),
    )


def _several(field: str, given: object) -> tuple[str, ...]:
    names = (given,) if isinstance(given, str) or not isinstance(given, Iterable) else tuple(given)
    if not all(isinstance(name, str) for name in names):
        raise InputError(f"{field}: {given!r} is not allowed; expected text")
    return names
