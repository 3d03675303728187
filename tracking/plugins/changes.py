"""Changes of values that a plug-in was given and must leave as they are."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def contents(value: Any, path: str) -> dict[str, object]:  # noqa: ANN401 - whatever a value holds
    """Everything in a value by its path: fields, entries and arrays, with their flag for writing."""
    if isinstance(value, np.ndarray):
        return {path: (value.dtype.str, value.shape, value.tobytes()), f"writing to {path}": value.flags.writeable}
    if is_dataclass(value):
        parts = {f"{path}.{f.name}": getattr(value, f.name) for f in fields(value)}
    elif isinstance(value, Mapping):
        parts = {f"{path}[{key!r}]": entry for key, entry in value.items()}
    elif isinstance(value, list | tuple):
        parts = {f"{path}[{k}]": entry for k, entry in enumerate(value)}
    else:
        return {path: value}
    found: dict[str, object] = {f"{path}, what it holds": tuple(parts)}
    for name, part in parts.items():
        found |= contents(part, name)
    return found


def change(before: Mapping[str, object], after: Mapping[str, object]) -> str:
    """The first difference, in words; empty: none."""
    for path, value in before.items():
        if path not in after or after[path] != value:
            return f"{path} is changed"
    return ""
