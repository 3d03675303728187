"""Settings as text: what `--set` and `--planner` take."""

import json
import os
import re
from collections.abc import Mapping
from typing import Any

from sim.scenario.loading import checked, load
from sim.scenario.scenario import Scenario
from tracking.plugins.registry import InputError

_PLAIN = re.compile(r"(?!(?:true|false|inf|nan)$)[A-Za-z_][\w.:/-]*")


def flat(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as one of dotted keys; lists stay whole."""
    found: dict[str, Any] = {}
    for key, value in data.items():
        found |= flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return found


def toml(value: Any) -> str:  # noqa: ANN401 - plain TOML data
    """A value as `--set key=value` reads it: TOML, a plain word without quotes."""
    return value if isinstance(value, str) and _PLAIN.fullmatch(value) else _toml(value)


def texts(settings: Mapping[str, Any]) -> dict[str, str]:
    """Settings by dotted key, their values as `--set` reads them."""
    return {key: toml(value) for key, value in flat(settings).items()}


def overrides(settings: Mapping[str, Any] | None) -> list[str]:
    """Settings as `--set` takes them, each `key=value`; InputError if they are no mapping."""
    if not isinstance(settings, Mapping | None):
        raise InputError(f"settings: {settings!r} is not allowed; expected a mapping, as {{'duration': 10}}")
    return [f"{key}={value}" for key, value in texts(settings or {}).items()]


def chosen(scenario: str | Scenario, settings: Mapping[str, Any] | None) -> Scenario:
    """A packaged scenario or .toml file with settings that differ, or a scenario, checked; InputError if neither."""
    if isinstance(scenario, str | os.PathLike):
        return load(os.fspath(scenario), overrides(settings))
    if not isinstance(scenario, Scenario):
        raise InputError(f"scenario: {scenario!r} is not allowed; expected a name, a .toml file or a Scenario")
    if settings:
        raise InputError("settings: not allowed with a Scenario; set its fields")
    return checked(scenario)


def _toml(value: Any) -> str:  # noqa: ANN401 - plain TOML data
    if hasattr(value, "tolist"):  # an array or number of NumPy's
        return _toml(value.tolist())
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return str(value)
