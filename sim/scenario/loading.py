"""Loading of scenario files: from TOML to a valid `Scenario` or an error of one line."""

import json
import os
from collections.abc import Collection, Mapping, Sequence
from datetime import date, time
from pathlib import Path
from typing import Any

import msgspec

from sim.installation import ASSETS
from sim.scenario.csv_tables import find_map_origin
from sim.scenario.environment import STANDS, TRAJECTORIES
from sim.scenario.overrides import apply_overrides
from sim.scenario.quantities import parse_iso_time
from sim.scenario.scenario import Scenario, ScenarioSettings, leave_out_removed_keys
from sim.scenario.settings_text import format_overrides
from sim.scenario.text_files import find_toml_file, read_toml
from tracking.errors import InputError, did_you_mean
from tracking.settings import read_settings

STUDY_TABLES = ("study", "set", "factors", "exclude", "score")  # tables of a study file
# Keys that are not part of a scenario, and their meaning elsewhere.
_ELSEWHERE = {
    **{name: f"an option: --{name}" for name in ("seed", "seeds", "planner", "out", "workers")},
    "video": "an option: --no-video",
    **dict.fromkeys((*STUDY_TABLES, "planners"), "one of a study, which `understory compare` flies"),
}
_FILES = (
    ("trees", "file", STANDS),
    ("people", "trajectories", TRAJECTORIES),
)  # keys that name files, and packaged ones
SCENARIOS = {path.stem: path for path in sorted((ASSETS / "scenarios").glob("*.toml"))}


def load_scenario(name: str, overrides: Sequence[str] = ()) -> Scenario:
    """Load the packaged scenario or TOML file `name` with `key=value` overrides; InputError says what is wrong.

    Paths of the user's files are relative to the scenario file's folder; in an override, to the current folder. An
    error about a key begins with `place_of`, which mentions overrides only if the file alone is without that error.
    """
    path = find_toml_file(name, SCENARIOS, "scenario")
    data = read_toml(path, "scenario")
    _anchor_cameras(data, path.parent)
    apply_overrides(data, overrides)
    changed = {override.partition("=")[0].strip() for override in overrides}
    try:
        return _anchor(decode(data), path.parent, changed)
    except InputError as error:
        own = _find_own_error(name) if overrides else ""
        raise InputError(own if own.endswith(str(error)) else f"{place_of(name, overrides)}{error}") from error


def _find_own_error(name: str) -> str:
    """Error message of a scenario without overrides; empty if there is no error."""
    try:
        load_scenario(name)
    except InputError as error:
        return str(error)
    return ""


def place_of(scenario: object, settings: Collection[str] | None) -> str:
    """Beginning of an error about a scenario: its file, and a remark if settings are changed; empty without a file."""
    if not isinstance(scenario, str | os.PathLike) or os.fspath(scenario) in SCENARIOS:
        return ""
    return f"{os.fspath(scenario)}{' with other settings' if settings else ''}: "


def resolve_scenario(scenario: str | Scenario, settings: Mapping[str, Any] | None) -> Scenario:
    """A checked scenario: a packaged one, a .toml file or a `Scenario`, with changed settings; else InputError."""
    if isinstance(scenario, str | os.PathLike):
        return load_scenario(os.fspath(scenario), format_overrides(settings))
    if not isinstance(scenario, Scenario):
        raise InputError(f"scenario: {scenario!r} is not allowed; expected a name, a .toml file or a Scenario")
    try:  # unlike the reading of a file, constructors check neither types nor bounds
        checked = decode(msgspec.to_builtins(scenario, enc_hook=_make_plain))
    except TypeError as error:
        raise InputError(f"scenario: {error}") from error
    return change_settings(checked, settings)


def change_settings(scenario: Scenario, settings: Mapping[str, Any] | None) -> Scenario:
    """The scenario with changed settings; InputError unless the result is valid."""
    overrides = format_overrides(settings)
    if not overrides:
        return scenario
    data = msgspec.json.decode(msgspec.json.encode(scenario))
    apply_overrides(data, overrides)
    return _anchor(decode(data), Path())


def decode(data: Mapping[str, Any]) -> Scenario:
    """A scenario from plain data; InputError unless every key is known and every value of its type and range."""
    for key in data:
        if key in _ELSEWHERE:
            raise InputError(f"{key}: unknown key; it is not part of a scenario, but {_ELSEWHERE[key]}")
    settings = read_settings(_read_start(data), ScenarioSettings)
    try:
        return settings.complete()
    except ValueError as error:
        raise InputError(str(error)) from error


def _read_start(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The data with seconds since 1970 as `people.start`, if that is a time such as 2024-05-01T10:00:00+02:00."""
    people = data.get("people")
    start = people.get("start") if isinstance(people, Mapping) else None
    if not isinstance(people, Mapping) or not isinstance(start, str | date | time):
        return data
    try:
        seconds = parse_iso_time(str(start))
    except ValueError as error:
        raise InputError(f"people.start: {error}") from error
    if seconds is None:
        raise InputError(f"people.start: {start} is not allowed; expected seconds, or such as 2024-05-01T10:00:00Z")
    return {**data, "people": {**people, "start": seconds}}


def decode_recorded(text: str) -> Scenario:
    """The scenario of a recording, whichever release made it; ValueError if this release cannot read it."""
    return decode(leave_out_removed_keys(json.loads(text)))


def _make_plain(value: Any) -> Any:  # noqa: ANN401 - any value of a scenario's field
    """A NumPy array or number as Python's; TypeError for anything else."""
    if not hasattr(value, "tolist"):
        raise TypeError(f"{value!r} is not allowed; expected plain values")
    return value.tolist()


def _anchor_cameras(data: Mapping[str, Any], folder: Path) -> None:
    """Make paths of cameras' files absolute, in place; files are read with their UAV."""
    fleet = data.get("uavs")
    for row in fleet if isinstance(fleet, list) else ():
        name = row.get("camera") if isinstance(row, dict) else None
        if isinstance(name, str) and Path(name).suffix:
            row["camera"] = os.path.join(folder, name)


def _anchor(scenario: Scenario, folder: Path, changed: Collection[str] = ()) -> Scenario:
    """The scenario with absolute paths of the user's files, and their origin on the map; names of packaged files stay.

    Paths are relative to `folder`, or to the current folder if their key or its table is among the `changed` ones.
    """
    if scenario.ground.file:
        raise InputError("ground.file: is for flights that `understory track` reads; the ground of missions is flat")
    for table, key, packaged in _FILES:
        settings = getattr(scenario, table)
        name = getattr(settings, key)
        if not name or name in packaged:
            continue
        here = table in changed or f"{table}.{key}" in changed
        path = os.path.abspath(Path() / name if here else folder / name)
        if not path.endswith(".csv") and not os.path.lexists(path):
            hint = did_you_mean(name, packaged)
            raise InputError(f"{table}.{key}: {name!r} is unknown; {hint} (or a file such as .csv)")
        scenario = msgspec.structs.replace(scenario, **{table: msgspec.structs.replace(settings, **{key: path})})
        if scenario.geo.origin is None and (origin := find_map_origin(Path(path), f"{table}.{key}", scenario.geo)):
            geo = msgspec.structs.replace(scenario.geo, origin=origin)
            scenario = msgspec.structs.replace(scenario, geo=geo)
    return scenario
