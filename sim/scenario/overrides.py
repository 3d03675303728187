"""Overrides `key=value` of single keys of a scenario."""

import re
from collections.abc import Sequence
from typing import Any

import msgspec

from sim.scenario.camera_settings import read_camera
from sim.scenario.environment import APPEARANCES
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import parse_toml
from sim.scenario.uavs import DEFAULT_FLEET, UavSettings
from tracking.errors import InputError
from tracking.navigation import NAVIGATION
from tracking.settings import read_settings

_ALL = "uavs.*."  # beginning of a key of all UAVs
_VIEW = ("footprint", "fov_deg", "altitude")  # keys of a UAV, two of which determine the third


def split_override(override: str) -> tuple[str, str]:
    """Key and value of an override as text; InputError if it does not have the form key=value."""
    key, equals, text = (part.strip() for part in override.partition("="))
    if not equals or not key:
        raise InputError(f"--set: {override!r} is not of the form key=value, for instance trees.density=75")
    return key, text


def apply_overrides(data: dict[str, Any], overrides: Sequence[str]) -> None:
    """Apply overrides `key=value` to plain data, in place; `uavs.*.key` is a key of all UAVs."""
    keys: list[str] = []
    for override in overrides:
        for single in _spread(data, override):
            _apply_override(data, single, keys)
            keys.append(split_override(single)[0])


def _spread(data: dict[str, Any], override: str) -> list[str]:
    """An override for each UAV, if it is one for all of them."""
    key, text = split_override(override)
    fleet = data.get("uavs", DEFAULT_FLEET)
    if not key.startswith(_ALL) or not isinstance(fleet, list | tuple) or not fleet:
        return [override]
    return [f"uavs.{i}.{key.removeprefix(_ALL)}={text}" for i in range(len(fleet))]


def _apply_override(data: dict[str, Any], override: str, earlier: Sequence[str]) -> None:
    """Apply an override, given the keys of those before it."""
    key, text = split_override(override)
    *path, last = key.split(".")
    node: Any = data
    row: Any = None  # of the third level, as that of a UAV
    default: Any = msgspec.json.decode(msgspec.json.encode(Scenario()))
    for i, part in enumerate(path):
        if isinstance(node, dict):
            default = default.get(part) if isinstance(default, dict) else None
            node.setdefault(part, default if isinstance(default, list) else {})  # a list keeps its other rows
        entry = _find_entry(node, part, key)
        node[entry] = node = _spell_out(part, node[entry])
        if not isinstance(node, dict | list):
            hint = "; set it as a whole first" if node is None else ""
            raise InputError(f"{key}: {'.'.join(path[: i + 1])} has no keys{hint}")
        row = node if i == 1 else row
    if path[:1] == ["uavs"] and last in _VIEW and isinstance(node, dict):
        _keep_view(node, last, [name for name in _VIEW if f"{key.removesuffix(last)}{name}" in earlier])
    if path[:1] == ["uavs"] and (*path, last)[2:3] == ("camera",) and isinstance(row, dict):
        for name in ("fov_deg", "pixels"):  # which follow from the camera
            if f"{path[0]}.{path[1]}.{name}" not in earlier:
                row.pop(name, None)
    node[_find_entry(node, last, key)] = parse_value(text)


def _spell_out(key: str, value: Any) -> Any:  # noqa: ANN401 - plain data
    """The table that a name stands for, as one of its keys may be changed; else the value."""
    if not isinstance(value, str):
        return value
    if key == "camera":
        return msgspec.to_builtins(read_camera(value))
    if key == "navigation":
        return msgspec.to_builtins(NAVIGATION.get(value, value))
    return msgspec.to_builtins(APPEARANCES.get(value, value)) if key == "appearance" else value


def _keep_view(row: dict[str, Any], key: str, earlier: Sequence[str]) -> None:
    """Leave of a UAV's view in its row what an override of `key` does not change, given the keys of earlier overrides.

    An override of the altitude changes the footprint; one of the footprint or of the angle of view changes the
    altitude. After two overrides, the third key follows.
    """
    if row.get("camera"):  # it has the angle of view, so that the footprint gives the altitude, or the reverse
        for name in {"footprint", "altitude"} - {key}:
            row.pop(name, None)
        return
    kept = {name: row[name] for name in _VIEW if name in row}
    if earlier:
        kept = {name: row[name] for name in earlier}
    else:
        try:
            before = read_settings({"start": (0.0, 0.0), **kept}, UavSettings).complete()
        except ValueError:  # which is told when the whole row is read
            return
        name = "footprint" if key == "fov_deg" else "fov_deg"
        kept = {name: getattr(before, name)}
    for name in _VIEW:
        row.pop(name, None)
    row |= kept


def _find_entry(node: dict[str, Any] | list[Any], text: str, key: str) -> Any:  # noqa: ANN401 - a key or an index
    if isinstance(node, dict):
        return text
    if not re.fullmatch("[0-9]{1,9}", text) or int(text) >= len(node):
        every = ", or * for all, as in uavs.*.altitude" if key.startswith("uavs.") else ""
        allowed = f"allowed are 0 to {len(node) - 1}{every}" if node else "the list is empty, so give all of it"
        raise InputError(f"{key}: {text!r} is not an index; {allowed}")
    return int(text)


def parse_value(text: str) -> Any:  # noqa: ANN401 - plain TOML data
    """The TOML value in a text; text that is none stands for itself."""
    try:
        found = parse_toml(f"value = {text}", "--set")
    except InputError:
        return text.strip()
    return found["value"] if len(found) == 1 else text  # a text of several lines may define further keys
