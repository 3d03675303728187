"""Studies: combinations of scenarios, overrides, planners and seeds, from TOML files or options."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import islice, product
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from sim.installation import ASSETS
from sim.scenario.loading import STUDY_TABLES
from sim.scenario.overrides import split_override
from sim.scenario.quantities import MOST_LISTED, REPEATS, parse_integer, parse_integers, parse_seed_and_repeat
from sim.scenario.settings_text import flatten, format_overrides, format_settings, format_value
from sim.scenario.text_files import find_toml_file, read_toml
from tracking.errors import InputError, check_known, did_you_mean
from tracking.settings import read_settings

STUDIES = {path.stem: path for path in sorted((ASSETS / "studies").glob("*.toml"))}


class ScoreScale(Struct, frozen=True, forbid_unknown_fields=True):
    """Ends of the normalised score of a study, two planners that are always flown besides the compared ones."""

    floor: str  # planner with the score 0
    bound: str  # planner with the score 1, which flies with an unlimited field of view and ideal sensing
    metric: str = "gospa.mean_m"


class Study(Struct, frozen=True):
    """A study: each planner flies each seed in each cell, which is a scenario with one level of each factor."""

    name: Annotated[str, Meta(pattern=r"^\w[\w.-]*$")]
    planners: tuple[str, ...]
    description: str = ""
    seeds: str = "0-9"  # in the form of --seeds
    repeats: Annotated[int, Meta(ge=1, le=REPEATS)] = 1  # number of flights on each seed's map
    scenarios: tuple[str, ...] = ("forest",)
    settings: dict[str, str] = {}  # overrides for all trials, with values in the form of --set
    factors: dict[str, dict[str, dict[str, Any]]] = {}  # overrides and `planner` options by name and level
    exclude: tuple[dict[str, Any], ...] = ()  # lists of names by key; trials that match all of a rule are left out
    score: ScoreScale | None = None
    file: str = ""  # file or name of a packaged study; empty if it is made of options
    given: dict[str, str] = {}  # overrides for all trials from outside of the file

    def at(self, field: str) -> str:
        """Beginning of an error message about a field, with the study's file if it has one."""
        return f"{self.file}: {field}" if self.file else field


def read_study(name: str) -> Study:
    """Read the packaged study or TOML file `name`; InputError says what is wrong."""
    path = find_toml_file(name, STUDIES, "study")
    data = read_toml(path, "study")
    _check_keys(data, STUDY_TABLES, f"{name}: ")
    for key in ("study", "set", "factors", "score"):
        _check_table(data.get(key, {}), f"{name}: {key}")
    table = data.get("study", {})
    for key in STUDY_TABLES:
        if key in table:
            raise InputError(f"{name}: study.{key}: is no key of [study] but a table of its own")
    _check_keys(table, ("name", "description", "scenarios", "seeds", "repeats", "planners"), f"{name}: study.")
    for factor, levels in data.get("factors", {}).items():
        _check_table(levels, f"{name}: factors.{factor}")
        for level, values in levels.items():
            _check_table(values, f"{name}: factors.{factor}.{level}")
    content = {"name": path.stem, **table, "settings": format_settings(data.get("set", {})), "file": name}
    content |= {key: data[key] for key in ("factors", "exclude", "score") if key in data}
    try:
        study = read_settings(content, Study)
    except InputError as error:
        inside = "" if re.match(r"(exclude|score)\b", str(error)) else "study."
        raise InputError(f"{name}: {inside}{error}") from error
    parse_integers(study.seeds, study.at("study.seeds"))
    _check_excluded(study)

    def anchor(scenarios: Sequence[str]) -> list[str]:
        return [str(path.parent / s) if s.endswith(".toml") else s for s in scenarios]

    rules = [
        {key: anchor(_make_list(value)) if key == "scenario" else _make_list(value) for key, value in rule.items()}
        for rule in study.exclude
    ]
    return msgspec.structs.replace(study, scenarios=tuple(anchor(study.scenarios)), exclude=tuple(rules))


def _make_list(value: object) -> list[Any]:
    """The values of an entry of `exclude`, which may be a single value or a list."""
    return value if isinstance(value, list) else [value]


def _check_table(given: object, where: str) -> None:
    """InputError that begins with `where` if the value is not a table."""
    if not isinstance(given, Mapping):
        raise InputError(f"{where}: {given!r} is not allowed; expected a table")


def _check_excluded(study: Study) -> None:
    """InputError if a study excludes a planner, scenario or level that it does not have."""
    ends = (study.score.floor, study.score.bound) if study.score else ()
    known = {"planner": (*study.planners, *ends), "scenario": study.scenarios, **study.factors}
    for i, rule in enumerate(study.exclude):
        where = study.at(f"exclude.{i}.")
        if not rule:
            raise InputError(f"{where[:-1]}: is empty; expected one or more of {', '.join(known)}")
        _check_keys(rule, known, where)
        for key, value in rule.items():
            if value == []:
                raise InputError(f"{where}{key}: is empty; expected text, or a list of texts")
            for name in _make_list(value):
                if not isinstance(name, str):
                    raise InputError(f"{where}{key}: {name!r} is not allowed; expected text, or a list of texts")
                check_known(f"{where}{key}", name, known[key])


def adapt_study(
    study: Study,
    *,
    planners: Sequence[str] = (),
    scenarios: Sequence[str] = (),
    seeds: str | None = None,
    repeats: int | None = None,
    overrides: Sequence[str] = (),
    vary: Mapping[str, Sequence[Any]] = {},
) -> Study:
    """The study with given values in place of its own.

    Args:
        study: The study.
        planners: Planners in place of its own; empty to keep these.
        scenarios: Those of its scenarios to keep; empty for all.
        seeds: Seeds in the form of --seeds.
        repeats: Number of flights on each map.
        overrides: Settings as "key=value".
        vary: Levels by key: of a setting, or `planner.option`, or `scenario`. They take the place of those of a factor
            that varies this key alone, or are a further factor.

    Raises:
        InputError: If a factor sets the key of an override or of another factor, or the study lacks a scenario.
    """
    for scenario in scenarios:
        check_known("--scenario", scenario, study.scenarios)
    levels = dict(vary)
    worlds = tuple(map(str, levels.pop("scenario", ())))
    added = dict(map(split_override, overrides))
    own = {factor: key for key, factor in product(levels, study.factors) if _list_keys(study, factor) == {key}}
    for option, keys in (("--set", added), ("--vary", {*levels} - {*own.values()})):
        for key, factor in product(keys, study.factors):
            if any(overlap(key, other) for other in _list_keys(study, factor)):
                raise InputError(f"{option}: {key} is what factor {factor!r} of study {study.name} varies")
    for key, other in product(added, levels):
        if overlap(key, other):
            raise InputError(f"--set: {key} is what --vary {other} varies")
    names = {key: factor for factor, key in own.items()}
    factors = {names.get(key, key): _make_levels(key, values) for key, values in levels.items()}
    return msgspec.structs.replace(
        study,
        planners=tuple(dict.fromkeys(planners)) or study.planners,
        scenarios=tuple(dict.fromkeys(worlds or scenarios)) or study.scenarios,
        factors={**study.factors, **factors},
        seeds=study.seeds if seeds is None else seeds,
        repeats=study.repeats if repeats is None else repeats,
        given={**study.given, **added},
    )


def _list_keys(study: Study, factor: str) -> set[str]:
    """Dotted keys that a factor's levels set."""
    return {key for level in study.factors[factor].values() for key in flatten(level)}


def _make_levels(key: str, values: Sequence[Any]) -> dict[str, dict[str, Any]]:
    """The levels of a factor that sets one key of the scenario, or one option of the planners."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InputError(f"vary: {key}: {values!r} is not allowed; expected several levels, such as [1, 2]")
    table, _, option = key.partition(".")
    if table in ("planner", "tracker") and not option:
        raise InputError(f"--vary: {key} is no setting; name each with --{key}")
    return {format_value(v): {table: {option: v}} if table == "planner" else {key: v} for v in values}


def overlap(one: str, other: str) -> bool:
    """True if one of two keys is the other, or a table that has it; a star is any part."""
    return all(a == b or "*" in (a, b) for a, b in zip(one.split("."), other.split("."), strict=False))


def make_study(
    planners: object,
    scenarios: object,
    *,
    seeds: Iterable[int],
    repeats: int,
    settings: Mapping[str, Any] | None,
    vary: Mapping[str, Sequence[Any]] | None = None,
) -> Study:
    """A study of one or several planners in one or several scenarios, from arguments of Python; else InputError."""
    if isinstance(seeds, str) or not isinstance(seeds, Iterable):
        raise InputError(f"seeds: {seeds!r} is not allowed; expected several integers, such as range(10)")
    numbers = (parse_seed_and_repeat(seed, 0)[0] for seed in islice(seeds, MOST_LISTED + 1))
    return adapt_study(
        Study("compare", _read_names("planners", planners), scenarios=_read_names("scenarios", scenarios)),
        seeds=",".join(map(str, numbers)),  # the parser refuses one more than allowed
        repeats=parse_integer(repeats, "repeats", least=1, most=REPEATS),
        overrides=format_overrides(settings),
        vary=vary or {},
    )


def _read_names(field: str, given: object) -> tuple[str, ...]:
    names = (given,) if isinstance(given, str) or not isinstance(given, Iterable) else tuple(given)
    if not all(isinstance(name, str) for name in names):
        raise InputError(f"{field}: {given!r} is not allowed; expected text")
    return names


def _check_keys(data: Iterable[str], known: Collection[str], where: str) -> None:
    """InputError for a key that is not known; `where` precedes the key in the message."""
    for key in data:
        if key not in known:
            raise InputError(f"{where}{key}: unknown key; {did_you_mean(key, known)}")
