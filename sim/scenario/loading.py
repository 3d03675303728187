"""Loading of scenario files: TOML in, a valid `Scenario` or an error of one line out."""

import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import msgspec

from sim.installation import ASSETS
from sim.scenario.environment import TRAJECTORIES, People
from sim.scenario.fleet import Cut, Uav
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import located, toml, toml_file
from tracking.plugins.registry import InputError
from tracking.plugins.spelling import did_you_mean

# Settings beside the scenario, and the options that give them.
_ELSEWHERE = {
    "seed": "--seed",
    "seeds": "--seeds",
    "planner": "--planner",
    "out": "--out",
    "video": "--no-video",
    "workers": "--workers",
}
_DEEPEST = 10  # parts of a key that are looked at
_ROWS = {"uavs": Uav, "cuts": Cut}  # lists of tables
SCENARIOS = {path.stem: path for path in sorted((ASSETS / "scenarios").glob("*.toml"))}


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


def decode(data: Mapping[str, Any]) -> Scenario:
    """A scenario from plain data, strictly: every key known, every value of its type and range."""
    _check_keys(data, Scenario, "")
    _check_finite(data, "")
    try:
        return msgspec.convert(data, Scenario)
    except msgspec.ValidationError as error:
        raise InputError(_readable(str(error), data)) from error


def remarks(scenario: Scenario) -> list[str]:
    """Remarks on settings without the effect that they suggest, one line each."""
    found, last = [], scenario.scan_times[-1]
    if not math.isclose(last, scenario.duration):
        scans = f"the last scan is at {last:g} s"
        interval = f"{1 / scenario.rates.sensing:g} s between scans"
        found.append(f"duration: {scenario.duration:g} s is no multiple of the {interval}; {scans}")
    people, default = scenario.people, People()
    if scenario.trees.per_hectare is not None and scenario.trees.density != Scenario().trees.density:
        found.append("trees.density: not used, as trees.per_hectare gives the number of trees")
    if people.trajectories:
        given = [name for name in People.__struct_fields__ if getattr(people, name) != getattr(default, name)]
        unused = ", ".join(f"people.{name}" for name in given if name != "trajectories")
        if unused:
            found.append(f"{unused}: not used, as people.trajectories gives all paths")
    return found + _about_false_alarms(scenario)


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


def _override(data: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    if not equals or not key.strip():
        raise InputError(f"--set: {override!r} is not of the form key=value, for instance trees.density=75")
    *path, last = key.strip().split(".", _DEEPEST)
    node: Any = data
    fleet = list(msgspec.to_builtins(Scenario().uavs))  # a list of tables, of which an override changes one
    for i, part in enumerate(path):
        if isinstance(node, dict):
            node.setdefault(part, fleet if path[: i + 1] == ["uavs"] else {})
        node = node[_place(node, part, key)]
        if not isinstance(node, dict | list):
            raise InputError(f"--set: {key}: {'.'.join(path[: i + 1])} has no keys")
    node[_place(node, last, key)] = _value(text)


def _place(node: dict[str, Any] | list[Any], text: str, key: str) -> Any:  # noqa: ANN401 - a key or an index
    if isinstance(node, dict):
        return text
    if not re.fullmatch("[0-9]{1,9}", text) or int(text) >= len(node):
        raise InputError(f"--set: {key}: {text!r} is not an index; allowed are 0 to {len(node) - 1}")
    return int(text)


def _value(text: str) -> Any:  # noqa: ANN401 - plain TOML data
    try:
        return toml(f"value = {text}", "--set")["value"]
    except InputError:
        return text.strip()


def _check_keys(data: object, kind: Any, where: str) -> None:  # noqa: ANN401 - a type
    if not isinstance(data, Mapping) or not isinstance(kind, type) or not issubclass(kind, msgspec.Struct):
        return
    fields = {f.name: f.type for f in msgspec.structs.fields(kind)}
    for key, value in data.items():
        if key not in fields:
            if not where and key in _ELSEWHERE:
                raise InputError(f"{key}: unknown key; no part of a scenario, but an option: {_ELSEWHERE[key]}")
            elsewhere = "" if where else _whole(key)
            hint = f"did you mean {elsewhere}?" if elsewhere else did_you_mean(key, fields)
            raise InputError(f"{where}{key}: unknown key; {hint}")
        _check_keys(value, fields[key], f"{where}{key}.")
        if key in _ROWS and isinstance(value, list):
            for i, row in enumerate(value):
                _check_keys(row, _ROWS[key], f"{where}{key}.{i}.")


def _whole(key: str) -> str:
    """The whole names of a key that stands in tables of a scenario, joined by "or"."""
    tables = {f.name: f.type for f in msgspec.structs.fields(Scenario) if hasattr(f.type, "__struct_fields__")}
    return " or ".join(f"{table}.{key}" for table, kind in tables.items() if key in kind.__struct_fields__)


def _check_finite(data: object, where: str) -> None:
    if isinstance(data, Mapping):
        for key, value in data.items():
            _check_finite(value, f"{where}.{key}" if where else key)
    elif isinstance(data, list):
        for i, value in enumerate(data):
            _check_finite(value, f"{where}.{i}")
    elif isinstance(data, float) and not math.isfinite(data):
        raise InputError(f"{where}: {data} is not allowed; expected a finite number")


def _choices(parts: Sequence[str]) -> tuple[object, ...]:
    """The allowed values of the field that the parts of a path lead to."""
    kind: Any = Scenario
    for part in parts:
        kind = Uav if part.isdigit() else {f.name: f.type for f in msgspec.structs.fields(kind)}[part]
        kind = Uav if part == "uavs" else kind
    return get_args(kind)


def _readable(message: str, data: Any) -> str:  # noqa: ANN401 - plain TOML data
    """The message of msgspec with the field first and the offending value in it."""
    text, _, path = message.partition(" - at `$")
    parts = re.findall(r"[^.\[\]`]+", path)
    value = data
    for part in parts:
        value = value[int(part)] if isinstance(value, list) else value.get(part)
    text = text[0].lower() + text[1:].replace("`", "")
    if text.startswith("invalid enum value"):
        text = did_you_mean(str(value), map(str, _choices(parts)))
    if not parts or isinstance(value, Mapping):
        return f"{'.'.join(parts)}: {text}" if parts else text
    return f"{'.'.join(parts)}: {value!r} is not allowed; {text}"
