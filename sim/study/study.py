"""Studies: scenarios by overrides by planners by seeds, from TOML or flags."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from sim.installation import ASSETS
from sim.scenario.errors import InputError
from sim.scenario.quantities import REPEATS, integers
from sim.scenario.text_files import toml_file
from sim.study.settings_text import flat, option, toml
from tracking.plugins.spelling import did_you_mean

STUDIES = {path.stem: path for path in sorted((ASSETS / "studies").glob("*.toml"))}
_MOST_CELLS = 10_000
_OTHER = ("planner", "scenario")  # what trials are left out by, beside factors


class Study(Struct, frozen=True):
    """A study: each planner on each seed in each cell, a cell being a scenario and a level of each factor."""

    name: Annotated[str, Meta(pattern=r"^\w[\w.-]*$")]
    planners: tuple[str, ...]
    description: str = ""
    seeds: str = "0-9"  # as --seeds takes them
    repeats: Annotated[int, Meta(ge=1, le=REPEATS)] = 1  # of each seed's map
    scenarios: tuple[str, ...] = ("forest",)
    settings: dict[str, str] = {}  # overrides for all trials, values as --set takes them
    factors: dict[str, dict[str, dict[str, Any]]] = {}  # of each name and level: overrides, and `planner` options
    exclude: tuple[dict[str, str | list[str]], ...] = ()  # trials that match all entries of one are left out


class Cell(Struct, frozen=True):
    """One scenario with one level of each factor, and one planner."""

    scenario: str
    factors: tuple[tuple[str, str], ...]
    settings: dict[str, str]  # overrides
    planner: str  # as `Study.planners` has it
    options: dict[str, str]  # of the planner, by the levels

    @property
    def spec(self) -> str:
        """The planner with the options of the cell."""
        given = ", ".join(f"{name}={value}" for name, value in self.options.items())
        if not given:
            return self.planner
        head, bracket, rest = self.planner.strip().partition("(")
        inner = rest.removesuffix(")").strip()
        return f"{head}({inner}, {given})" if bracket and inner else f"{head}({given})"


def is_study(path: Path) -> bool:
    """True if a TOML file is a study, not a scenario."""
    return path.is_file() and "study" in toml_file(path, "study")


def read(name: str) -> Study:
    """The packaged study or TOML file `name`; InputError says what is wrong."""
    path = STUDIES.get(name, Path(name))
    if name not in STUDIES and path.suffix != ".toml":
        raise InputError(f"study: {name!r} is unknown; {did_you_mean(name, STUDIES)} (or a .toml file)")
    if not path.is_file():
        raise InputError(f"study: there is no file {name}")
    data = toml_file(path, "study")
    known = ("study", "set", "factors", "exclude")
    _check_keys(data, known, f"{name}: ")
    table = data.get("study", {})
    if not isinstance(table, Mapping):
        raise InputError(f"{name}: study: {table!r} is not allowed; expected a table [study]")
    _check_keys(table, ("name", "description", "scenarios", "seeds", "repeats", "planners"), f"{name}: study.")
    common = data.get("set", {})
    if not isinstance(common, Mapping):
        raise InputError(f"{name}: set: {common!r} is not allowed; expected a table [set]")
    content = {"name": path.stem, **table, "settings": {key: toml(value) for key, value in flat(common).items()}}
    content |= {key: data[key] for key in ("factors", "exclude") if key in data}
    try:
        study = msgspec.convert(content, Study)
    except msgspec.ValidationError as error:
        text, _, where = str(error).replace("`", "").partition(" - at $.")
        raise InputError(f"{name}: {where or 'study'}: {text[0].lower()}{text[1:]}") from error
    if name in STUDIES:
        return study
    return msgspec.structs.replace(study, scenarios=tuple(_anchored(s, path.parent) for s in study.scenarios))


def adapted(
    study: Study,
    *,
    planners: Sequence[str] = (),
    seeds: str | None = None,
    repeats: int | None = None,
    overrides: Sequence[str] = (),
) -> Study:
    """The study with what is given in place of its own; InputError where an override is what a factor sets."""
    added: dict[str, str] = {}
    for override in overrides:
        key, equals, value = (part.strip() for part in override.partition("="))
        if not equals or not key:
            raise InputError(f"--set: {override!r} is not of the form key=value, for instance trees.density=75")
        for factor, levels in study.factors.items():
            if any(_overlap(key, other) for level in levels.values() for other in flat(level)):
                raise InputError(f"--set: {key} is what factor {factor!r} of study {study.name} varies")
        added[key] = value
    return msgspec.structs.replace(
        study,
        planners=tuple(dict.fromkeys(planners)) or study.planners,
        seeds=study.seeds if seeds is None else seeds,
        repeats=study.repeats if repeats is None else repeats,
        settings={**study.settings, **added},
    )


def cells(study: Study) -> list[Cell]:
    """All cells of a study by all its planners, in order; InputError if there are none."""
    _check_levels(study)
    count = math.prod([len(study.scenarios), len(study.planners), *map(len, study.factors.values())])
    if count > _MOST_CELLS:  # before they are listed: factors multiply
        raise InputError(f"study: {study.name} has {count:g} cells; at most {_MOST_CELLS} are allowed")
    found = []
    for scenario, *chosen in product(study.scenarios, *(levels for levels in study.factors.values())):
        levels = tuple(zip(study.factors, chosen, strict=True))
        shown = (("scenario", Path(scenario).stem), *levels) if len(study.scenarios) > 1 else levels
        settings, options = dict(study.settings), dict[str, str]()
        for factor, level in levels:
            values = dict(study.factors[factor][level])
            options |= {key: option(value) for key, value in values.pop("planner", {}).items()}
            settings |= {key: toml(value) for key, value in flat(values).items()}
        for planner in study.planners:
            place = {"planner": planner, "scenario": scenario, **dict(levels)}
            if not any(_matches(rule, place) for rule in study.exclude):
                found.append(Cell(scenario, shown, settings, planner, options))
    if not found or not integers(study.seeds, "seeds"):
        raise InputError(f"study: {study.name} has no trial: no planner, no seed, no level, or all is excluded")
    return found


def _overlap(one: str, other: str) -> bool:
    """True if one key is the other, or holds it."""
    return one == other or one.startswith(f"{other}.") or other.startswith(f"{one}.")


def _matches(rule: Mapping[str, str | list[str]], place: Mapping[str, str]) -> bool:
    return all(place[key] in ([value] if isinstance(value, str) else value) for key, value in rule.items())


def _check_levels(study: Study) -> None:
    for factor, levels in study.factors.items():
        if factor in _OTHER:
            raise InputError(f"factors.{factor}: is no name for a factor; list them as {factor}s of [study]")
        for level, values in levels.items():
            if not isinstance(values.get("planner", {}), Mapping):
                raise InputError(f"factors.{factor}.{level}.planner: expected options such as {{horizon = 3}}")
    _check_rules(study)


def _check_rules(study: Study) -> None:
    for i, rule in enumerate(study.exclude):
        _check_keys(rule, (*study.factors, *_OTHER), f"exclude.{i}.")
        for factor, value in rule.items():
            for level in [value] if isinstance(value, str) else value:
                if factor in study.factors and level not in study.factors[factor]:
                    hint = did_you_mean(level, study.factors[factor])
                    raise InputError(f"exclude.{i}.{factor}: {level!r} is no level; {hint}")


def _check_keys(data: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    for key in data:
        if key not in known:
            raise InputError(f"{where}{key}: unknown key; {did_you_mean(key, known)}")


def _anchored(scenario: str, folder: Path) -> str:
    """A scenario file's path relative to the study file's folder."""
    return str(folder / scenario) if scenario.endswith(".toml") else scenario
