"""Loading of scenario files: from TOML to a valid `Scenario` or an error of one line."""

import math
import os
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

import msgspec

from sim.installation import ASSETS
from sim.scenario.environment import TRAJECTORIES
from sim.scenario.fleet import Cut, Uav
from sim.scenario.overrides import override_in
from sim.scenario.scenario import Scenario
from sim.scenario.settings_text import overrides as overrides_of
from sim.scenario.text_files import located, toml_file
from tracking.errors import InputError, did_you_mean

STUDY_TABLES = ("study", "set", "factors", "exclude", "score")  # tables of a study file
# Keys that are not part of a scenario, and their meaning elsewhere.
_ELSEWHERE = {
    **{name: f"an option: --{name}" for name in ("seed", "seeds", "planner", "out", "workers")},
    "video": "an option: --no-video",
    **dict.fromkeys((*STUDY_TABLES, "planners"), "one of a study, which `understory compare` flies"),
}
_ROWS = {"uavs": Uav, "cuts": Cut}  # lists of tables
SCENARIOS = {path.stem: path for path in sorted((ASSETS / "scenarios").glob("*.toml"))}
_Kind = TypeVar("_Kind")
# Names of types in error messages, by msgspec's names.
_KINDS = {"object": "a table", "array": "a list", "str": "text", "float": "a number", "int": "an integer"}
_KINDS["bool"] = "true or false"


def load(name: str, overrides: Sequence[str] = ()) -> Scenario:
    """Load the packaged scenario or TOML file `name` with `key=value` overrides; InputError says what is wrong.

    The path of a trajectory file is relative to the scenario file's folder; in an override, to the current folder. An
    error about a key begins with `place_of`, which mentions overrides only if the file alone is without that error.
    """
    path = located(name, SCENARIOS, "scenario")
    data = toml_file(path, "scenario")
    for override in overrides:
        override_in(data, override)
    named_here = any(o.partition("=")[0].strip() in ("people", "people.trajectories") for o in overrides)
    try:
        return _anchored(decode(data), Path() if named_here else path.parent)
    except InputError as error:
        own = _error_of(name) if overrides else ""
        raise InputError(own if own.endswith(str(error)) else f"{place_of(name, overrides)}{error}") from error


def _error_of(name: str) -> str:
    """Error message of a scenario without overrides; empty if there is no error."""
    try:
        load(name)
    except InputError as error:
        return str(error)
    return ""


def place_of(scenario: object, settings: Collection[str] | None) -> str:
    """Beginning of an error about a scenario: its file, and a remark if settings are changed; empty without a file."""
    if not isinstance(scenario, str | os.PathLike) or os.fspath(scenario) in SCENARIOS:
        return ""
    return f"{os.fspath(scenario)}{' with other settings' if settings else ''}: "


def chosen(scenario: str | Scenario, settings: Mapping[str, Any] | None) -> Scenario:
    """A checked scenario: a packaged one or a .toml file, with changed settings, or a `Scenario`; else InputError."""
    if isinstance(scenario, str | os.PathLike):
        return load(os.fspath(scenario), overrides_of(settings))
    if not isinstance(scenario, Scenario):
        raise InputError(f"scenario: {scenario!r} is not allowed; expected a name, a .toml file or a Scenario")
    if settings:
        raise InputError("settings: not allowed with a Scenario; set its fields")
    try:  # unlike the reading of a file, constructors check neither types nor bounds
        return decode(msgspec.to_builtins(scenario, enc_hook=_plain))
    except TypeError as error:
        raise InputError(f"scenario: {error}") from error


def decode(data: Mapping[str, Any]) -> Scenario:
    """A scenario from plain data; InputError unless every key is known and every value of its type and range."""
    _check_keys(data, Scenario, "")
    _check_finite(data, "")
    return converted(data, Scenario)


def converted(data: Mapping[str, Any], kind: type[_Kind]) -> _Kind:
    """Plain data as a struct; InputError names the field, its value and what is allowed."""
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise InputError(_readable(str(error), data)) from error


def _plain(value: Any) -> Any:  # noqa: ANN401 - any value of a scenario's field
    """A NumPy array or number as Python's; TypeError for anything else."""
    if not hasattr(value, "tolist"):
        raise TypeError(f"{value!r} is not allowed; expected plain values")
    return value.tolist()


def _anchored(scenario: Scenario, folder: Path) -> Scenario:
    """The scenario with the absolute path of its trajectory file, given relative to `folder`; a packaged one stays."""
    name = scenario.people.trajectories
    if not name or name in TRAJECTORIES:
        return scenario
    path = os.path.abspath(folder / name)
    if not path.endswith(".csv") and not os.path.lexists(path):
        raise InputError(
            f"people.trajectories: {name!r} is unknown; {did_you_mean(name, TRAJECTORIES)} (or a .csv file)"
        )
    return msgspec.structs.replace(scenario, people=msgspec.structs.replace(scenario.people, trajectories=path))


def _check_keys(data: object, kind: Any, where: str) -> None:  # noqa: ANN401 - a type
    if not isinstance(data, Mapping) or not isinstance(kind, type) or not issubclass(kind, msgspec.Struct):
        return
    fields = {f.name: f.type for f in msgspec.structs.fields(kind)}
    for key, value in data.items():
        if key not in fields:
            if not where and key in _ELSEWHERE:
                raise InputError(f"{key}: unknown key; it is not part of a scenario, but {_ELSEWHERE[key]}")
            elsewhere = _whole(key)
            hint = did_you_mean(key, fields)
            if elsewhere:
                hint = f"allowed are {', '.join(fields)}; " * bool(where) + f"did you mean {elsewhere}?"
            raise InputError(f"{where}{key}: unknown key; {hint}")
        _check_keys(value, fields[key], f"{where}{key}.")
        if key in _ROWS and isinstance(value, list):
            for i, row in enumerate(value):
                _check_keys(row, _ROWS[key], f"{where}{key}.{i}.")


def _whole(key: str) -> str:
    """Dotted names of all keys of a scenario's tables with the name `key`, joined by "or"; empty if there are none."""
    tables = {f.name: f.type for f in msgspec.structs.fields(Scenario) if hasattr(f.type, "__struct_fields__")}
    tables["uavs.0"] = Uav
    return " or ".join(f"{table}.{key}" for table, kind in tables.items() if key in kind.__struct_fields__)


def _check_finite(data: object, where: str) -> None:
    if isinstance(data, Mapping):
        for key, value in data.items():
            _check_finite(value, f"{where}.{key}" if where else key)
    elif isinstance(data, list | tuple):
        for i, value in enumerate(data):
            _check_finite(value, f"{where}.{i}")
    elif isinstance(data, float) and not math.isfinite(data):
        raise InputError(f"{where}: {data} is not allowed; expected a finite number")


def _choices(parts: Sequence[str]) -> tuple[object, ...]:
    """Allowed values of the field at a path, given by its parts."""
    kind: Any = Scenario
    for part in parts:
        if not part.isdigit():
            kind = _ROWS.get(part) or {f.name: f.type for f in msgspec.structs.fields(kind)}[part]
    return get_args(kind)


def _readable(message: str, data: Any) -> str:  # noqa: ANN401 - plain TOML data
    """A message of msgspec, rewritten so that it begins with the field and contains the offending value."""
    text, _, path = message.partition(" - at `$")
    parts = re.findall(r"[^.\[\]`]+", path)
    value = data
    for part in parts:
        value = value[int(part)] if isinstance(value, list | tuple) else value.get(part)
    missing = re.fullmatch(r"Object missing required field `(\w+)`", text)
    if missing:
        return f"{'.'.join([*parts, missing[1]])}: is missing, and has no default"
    text = text[0].lower() + text[1:].replace("`", "")
    for kind, name in _KINDS.items():
        text = re.sub(rf"(expected|got) {kind}\b", rf"\1 {name}", text)
    if text.startswith("invalid enum value"):
        text = did_you_mean(str(value), map(str, _choices(parts)))
    if text == "expected a list, got a table":
        text += f"; each of several is [[{'.'.join(parts)}]]"
    if not parts or isinstance(value, Mapping):
        return f"{'.'.join(parts)}: {text}" if parts else text
    return f"{'.'.join(parts)}: {value!r} is not allowed; {text}"
