"""Loading of scenario files: TOML in, a valid `Scenario` or an error of one line out."""

import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

import msgspec

from sim.installation import ASSETS
from sim.scenario.environment import TRAJECTORIES, People, Wind
from sim.scenario.fleet import Cut, Uav
from sim.scenario.scenario import Scenario
from sim.scenario.settings_text import overrides as overrides_of
from sim.scenario.text_files import located, toml, toml_file
from tracking.plugins.registry import InputError
from tracking.plugins.spelling import did_you_mean

STUDY_TABLES = ("study", "set", "factors", "exclude", "score")  # of a study file
# Keys that do not belong into a scenario, and what they are.
_ELSEWHERE = {
    **{name: f"an option: --{name}" for name in ("seed", "seeds", "planner", "out", "workers")},
    "video": "an option: --no-video",
    **dict.fromkeys((*STUDY_TABLES, "planners"), "one of a study, which `understory compare` flies"),
}
# Keys that are not used where another one, a part of the same table, has this value.
_UNUSED = {
    ("tracking.life", "existence"): ("confirm", "delete"),
    ("tracking.life", "m_of_n"): ("survival", "birth_density", "sure", "doubt"),
    ("tracking.motion", "ncv"): ("walking_speed",),
    ("tracking.initial_tracks", "known"): ("unseen",),
    ("sensing.mode", "ideal"): ("renderer", "detector"),
}
_DEEPEST = 10  # parts of a key that are looked at
_ROWS = {"uavs": Uav, "cuts": Cut}  # lists of tables
SCENARIOS = {path.stem: path for path in sorted((ASSETS / "scenarios").glob("*.toml"))}
_Kind = TypeVar("_Kind")
# Types in the words of TOML.
_KINDS = {"object": "a table", "array": "a list", "str": "text", "float": "a number", "int": "an integer"}
_KINDS["bool"] = "true or false"


def load(name: str, overrides: Sequence[str] = ()) -> Scenario:
    """The packaged scenario or TOML file `name`, with `key=value` overrides; InputError says what is wrong.

    The path of a trajectory file starts at the scenario file's folder, in an override at the current one.
    """
    path = located(name, SCENARIOS, "scenario")
    data = toml_file(path, "scenario")
    for override in overrides:
        _override(data, override)
    named_here = any(o.partition("=")[0].strip() in ("people", "people.trajectories") for o in overrides)
    return _anchored(decode(data), Path() if named_here else path.parent)


def chosen(scenario: str | Scenario, settings: Mapping[str, Any] | None) -> Scenario:
    """A packaged scenario or .toml file with settings that differ, or a scenario, checked; InputError if neither."""
    if isinstance(scenario, str | os.PathLike):
        return load(os.fspath(scenario), overrides_of(settings))
    if not isinstance(scenario, Scenario):
        raise InputError(f"scenario: {scenario!r} is not allowed; expected a name, a .toml file or a Scenario")
    if settings:
        raise InputError("settings: not allowed with a Scenario; set its fields")
    return checked(scenario)


def decode(data: Mapping[str, Any]) -> Scenario:
    """A scenario from plain data, strictly: every key known, every value of its type and range."""
    _check_keys(data, Scenario, "")
    _check_finite(data, "")
    return converted(data, Scenario)


def converted(data: Mapping[str, Any], kind: type[_Kind]) -> _Kind:
    """Plain data as a struct; InputError names the field, its value and what is allowed."""
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise InputError(_readable(str(error), data)) from error


def checked(scenario: Scenario) -> Scenario:
    """A scenario made in Python, checked as a file is: constructors check neither types nor bounds."""
    try:
        return decode(msgspec.to_builtins(scenario, enc_hook=_plain))
    except TypeError as error:
        raise InputError(f"scenario: {error}") from error


def _plain(value: Any) -> Any:  # noqa: ANN401 - an array or number of NumPy's, or anything that may stand in a scenario
    """NumPy's arrays and numbers as Python's; TypeError for anything else."""
    if not hasattr(value, "tolist"):
        raise TypeError(f"{value!r} is not allowed; expected plain values")
    return value.tolist()


def remarks(scenario: Scenario) -> list[str]:
    """Remarks on settings without the effect that they suggest, one line each."""
    found, last = [], scenario.scan_times[-1]
    if not math.isclose(last, scenario.duration):
        scans = f"the last scan is at {last:g} s"
        interval = f"{1 / scenario.rates.sensing:g} s between scans"
        found.append(f"duration: {scenario.duration:g} s is no multiple of the {interval}; {scans}")
    if scenario.trees.per_hectare is not None and scenario.trees.density != Scenario().trees.density:
        found.append("trees.density: not used, as trees.per_hectare gives the number of trees")
    if scenario.wind.gust_time != Wind().gust_time and not scenario.wind.gust:
        found.append("wind.gust_time: not used, as wind.gust is 0")
    return (
        found
        + _about_people(scenario.people)
        + _unused(scenario)
        + _about_misses(scenario)
        + _about_false_alarms(scenario)
    )


def _about_people(people: People) -> list[str]:
    """Remarks on keys of people without effect beside trajectories, or without the way of walking that they are for."""
    default = People()
    if people.trajectories:
        given = [name for name in People.__struct_fields__ if getattr(people, name) != getattr(default, name)]
        unused = ", ".join(f"people.{name}" for name in given if name != "trajectories")
        return [f"{unused}: not used, as people.trajectories gives all paths"] if unused else []
    if any(":" in walk for walk in people.walks):  # a way of the user's is given all keys
        return []
    return [
        f'people.{key}: not used, as people.walks lacks "{walk}"'
        for key, walk in (("group", "groups"), ("paths", "levy"))
        if getattr(people, key) not in ((), getattr(default, key)) and walk not in people.walks
    ]


def _unused(scenario: Scenario) -> list[str]:
    """Remarks on keys that are set and that the value of another key leaves without effect."""
    given, default = msgspec.to_builtins(scenario), msgspec.to_builtins(Scenario())
    found = []
    for (key, value), others in _UNUSED.items():
        table, _, name = key.partition(".")
        for other in others if given[table][name] == value else ():
            if given[table][other] != default[table][other]:
                found.append(f'{table}.{other}: not used with {key} = "{value}"')
    return found


def _about_misses(scenario: Scenario) -> list[str]:
    """A remark where the tracker expects to miss people less than half as often as they are missed."""
    missed, expected = scenario.sensing.miss_probability, scenario.tracking.detection_probability
    if missed <= 2 * (1.0 - expected):
        return []
    probability = f"tracking.detection_probability: {expected:g} is far above the {1.0 - missed:.2g}"
    return [f"{probability} that sensing.miss_probability means; misses will end tracks of people"]


def _about_false_alarms(scenario: Scenario) -> list[str]:
    """Remarks on settings of the tracker under which false alarms become tracks."""
    expected = scenario.sensing.false_alarms / min(uav.footprint * uav.footprint for uav in scenario.uavs)
    if expected == 0.0:
        return []
    found = []
    if scenario.tracking.clutter_density < expected / 10:
        density = f"tracking.clutter_density: {scenario.tracking.clutter_density:g} per m2 is far below"
        found.append(f"{density} the {expected:.2g} that sensing.false_alarms means; tracks will follow false alarms")
    if scenario.tracking.life == "m_of_n":
        m, n = scenario.tracking.confirm
        found.append(f'tracking.life: {m} of {n} false alarms make a track; "existence" weighs them against clutter')
    return found


def _anchored(scenario: Scenario, folder: Path) -> Scenario:
    """The scenario with its trajectory file, unless that is packaged, found relative to the scenario file."""
    name = scenario.people.trajectories
    if not name or name in TRAJECTORIES:
        return scenario
    path = os.path.abspath(folder / name)
    if not path.endswith(".csv") and not os.path.lexists(path):
        raise InputError(
            f"people.trajectories: {name!r} is unknown; {did_you_mean(name, TRAJECTORIES)} (or a .csv file)"
        )
    return msgspec.structs.replace(scenario, people=msgspec.structs.replace(scenario.people, trajectories=path))


def key_and_value(override: str) -> tuple[str, str]:
    """Key and value of an override, as text; InputError unless it is of the form key=value."""
    key, equals, text = (part.strip() for part in override.partition("="))
    if not equals or not key:
        raise InputError(f"--set: {override!r} is not of the form key=value, for instance trees.density=75")
    return key, text


def _override(data: dict[str, Any], override: str) -> None:
    key, text = key_and_value(override)
    *path, last = key.split(".", _DEEPEST)
    node: Any = data
    default: Any = msgspec.json.decode(msgspec.json.encode(Scenario()))
    for i, part in enumerate(path):
        if isinstance(node, dict):
            default = default.get(part) if isinstance(default, dict) else None
            node.setdefault(part, default if isinstance(default, list) else {})  # an override changes one of a list
        node = node[_place(node, part, key)]
        if not isinstance(node, dict | list):
            raise InputError(f"{key}: {'.'.join(path[: i + 1])} has no keys")
    node[_place(node, last, key)] = _value(text)


def _place(node: dict[str, Any] | list[Any], text: str, key: str) -> Any:  # noqa: ANN401 - a key or an index
    if isinstance(node, dict):
        return text
    if not re.fullmatch("[0-9]{1,9}", text) or int(text) >= len(node):
        allowed = f"allowed are 0 to {len(node) - 1}" if node else "the list is empty, so give all of it"
        raise InputError(f"{key}: {text!r} is not an index; {allowed}")
    return int(text)


def _value(text: str) -> Any:  # noqa: ANN401 - plain TOML data
    try:
        found = toml(f"value = {text}", "--set")
    except InputError:
        return text.strip()
    return found["value"] if len(found) == 1 else text  # more than one of several lines


def _check_keys(data: object, kind: Any, where: str) -> None:  # noqa: ANN401 - a type
    if not isinstance(data, Mapping) or not isinstance(kind, type) or not issubclass(kind, msgspec.Struct):
        return
    fields = {f.name: f.type for f in msgspec.structs.fields(kind)}
    for key, value in data.items():
        if key not in fields:
            if not where and key in _ELSEWHERE:
                raise InputError(f"{key}: unknown key; no part of a scenario, but {_ELSEWHERE[key]}")
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
    """The whole names of a key that stands in tables of a scenario, joined by "or"; empty if there are none."""
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
    """The allowed values of the field that the parts of a path lead to."""
    kind: Any = Scenario
    for part in parts:
        if not part.isdigit():
            kind = _ROWS.get(part) or {f.name: f.type for f in msgspec.structs.fields(kind)}[part]
    return get_args(kind)


def _readable(message: str, data: Any) -> str:  # noqa: ANN401 - plain TOML data
    """The message of msgspec with the field first and the offending value in it."""
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
