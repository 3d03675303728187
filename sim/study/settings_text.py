"""Settings as text: what `--set` and `--planner` take."""

import json
import re
from collections.abc import Mapping
from typing import Any

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


def option(value: Any) -> str:  # noqa: ANN401 - plain TOML data
    """A value as an option of a planner."""
    return value if isinstance(value, str) else repr(value)


def _toml(value: Any) -> str:  # noqa: ANN401 - plain TOML data
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return str(value)
