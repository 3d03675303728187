"""Overrides `key=value` of single keys of a scenario."""

import re
from typing import Any

import msgspec

from sim.scenario.scenario import Scenario
from sim.scenario.text_files import parse_toml
from tracking.errors import InputError


def split_override(override: str) -> tuple[str, str]:
    """Key and value of an override as text; InputError if it does not have the form key=value."""
    key, equals, text = (part.strip() for part in override.partition("="))
    if not equals or not key:
        raise InputError(f"--set: {override!r} is not of the form key=value, for instance trees.density=75")
    return key, text


def apply_override(data: dict[str, Any], override: str) -> None:
    """Apply an override `key=value` to plain data, in place."""
    key, text = split_override(override)
    *path, last = key.split(".")
    node: Any = data
    default: Any = msgspec.json.decode(msgspec.json.encode(Scenario()))
    for i, part in enumerate(path):
        if isinstance(node, dict):
            default = default.get(part) if isinstance(default, dict) else None
            node.setdefault(part, default if isinstance(default, list) else {})  # a list keeps its other rows
        node = node[_find_entry(node, part, key)]
        if not isinstance(node, dict | list):
            raise InputError(f"{key}: {'.'.join(path[: i + 1])} has no keys")
    node[_find_entry(node, last, key)] = _parse_value(text)


def _find_entry(node: dict[str, Any] | list[Any], text: str, key: str) -> Any:  # noqa: ANN401 - a key or an index
    if isinstance(node, dict):
        return text
    if not re.fullmatch("[0-9]{1,9}", text) or int(text) >= len(node):
        allowed = f"allowed are 0 to {len(node) - 1}" if node else "the list is empty, so give all of it"
        raise InputError(f"{key}: {text!r} is not an index; {allowed}")
    return int(text)


def _parse_value(text: str) -> Any:  # noqa: ANN401 - plain TOML data
    try:
        found = parse_toml(f"value = {text}", "--set")
    except InputError:
        return text.strip()
    return found["value"] if len(found) == 1 else text  # a text of several lines may define further keys
