"""Settings as text, in the form that `--set` and `--planner` take."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from sim.scenario.scenario import Scenario
from tracking.errors import InputError

_PLAIN = re.compile(r"(?!(?:true|false|inf|nan)$)[A-Za-z_][\w.:/-]*")


def flatten(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as one table with dotted keys; lists and whole cameras, which have a width, are not flattened."""
    found: dict[str, Any] = {}
    for key, value in data.items():
        whole = not isinstance(value, Mapping) or (f".{key}".endswith(".camera") and "width" in value)
        found |= {f"{prefix}{key}": value} if whole else flatten(value, f"{prefix}{key}.")
    return found


def format_value(value: Any) -> str:  # noqa: ANN401 - plain TOML data
    """A value in the form that `--set key=value` reads: TOML, but a plain word has no quotes."""
    return value if isinstance(value, str) and _PLAIN.fullmatch(value) else _format_toml(value)


def format_settings(settings: Mapping[str, Any]) -> dict[str, str]:
    """Settings by dotted key, with values in the form that `--set` reads."""
    return {key: format_value(value) for key, value in flatten(settings).items()}


def format_overrides(settings: Mapping[str, Any] | None) -> list[str]:
    """Settings as a list of `key=value`, as `--set` takes them; InputError if they are not a mapping."""
    if not isinstance(settings, Mapping | None):
        raise InputError(f"settings: {settings!r} is not allowed; expected a mapping, as {{'duration': 10}}")
    return [f"{key}={value}" for key, value in format_settings(settings or {}).items()]


def list_changes(scenario: Scenario) -> list[str]:
    """Settings that differ from the defaults, as a list of `key=value`, as `--set` takes them."""
    given, default = msgspec.to_builtins(scenario), msgspec.to_builtins(Scenario())
    return [f"{key}={format_value(value)}" for key, value in _find_changes(given, default, "")]


def _find_changes(given: Mapping[str, Any], default: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Dotted keys with values other than the default; lists of tables of equal length are compared by table."""
    for key, value in given.items():
        before = default[key]
        lists = isinstance(value, list | tuple) and isinstance(before, list | tuple)
        if lists and len(value) == len(before) and isinstance(next(iter(value), None), dict):
            value, before = ({str(k): row for k, row in enumerate(rows)} for rows in (value, before))
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            yield from _find_changes(value, before, f"{prefix}{key}.")
        elif value != before:
            yield f"{prefix}{key}", value


def format_toml(settings: Mapping[str, Any]) -> str:
    """The settings of a scenario as the text of a TOML file."""
    return "".join(f"{key} = {_format_toml(value)}\n" for key, value in flatten(settings).items() if value is not None)


def _format_toml(value: Any) -> str:  # noqa: ANN401 - plain TOML data
    if hasattr(value, "tolist"):  # a NumPy array or number
        return _format_toml(value.tolist())
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(k)} = {_format_toml(v)}" for k, v in value.items() if v is not None) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_format_toml, value)) + "]"
    return str(value)
