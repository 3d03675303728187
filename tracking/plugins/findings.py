"""Findings of checks that a plug-in keeps its contract."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

_MARKS = {True: "passed", False: "FAILED", None: "-"}


@dataclass(frozen=True)
class Finding:
    """Result of one check."""

    check: str
    passed: bool | None  # None: not tried
    seen: str

    def __str__(self) -> str:
        return f"{_MARKS[self.passed]:<8}{self.check:<26}{self.seen}"


class Unfit(Exception):
    """Failure of a check; the message says what the plug-in does."""


class Untried(Exception):
    """A check that is not possible; the message says why."""


def finding(name: str, check: Callable[[], str]) -> Finding:
    """The finding of a check that returns what it saw, or raises `Unfit` or `Untried`."""
    try:
        return Finding(name, True, check())
    except Unfit as error:
        return Finding(name, False, str(error))
    except Untried as error:
        return Finding(name, None, f"not tried: {error}")


def find_change(before: Any, after: Any, path: str) -> str:  # noqa: ANN401 - any value
    """The first part of a value that differs from its copy from before, in words; empty if there is none."""
    if type(before) is not type(after):
        return f"{path} is changed"
    if isinstance(before, np.ndarray):
        same = before.dtype == after.dtype and before.shape == after.shape and before.tobytes() == after.tobytes()
        return "" if same else f"{path} is changed"
    if is_dataclass(before):
        parts = {f"{path}.{f.name}": (getattr(before, f.name), getattr(after, f.name)) for f in fields(before)}
    elif isinstance(before, Mapping):
        if before.keys() != after.keys():
            return f"{path} is changed"
        parts = {f"{path}[{key!r}]": (value, after[key]) for key, value in before.items()}
    elif isinstance(before, list | tuple):
        if len(before) != len(after):
            return f"{path} is changed"
        parts = {f"{path}[{k}]": pair for k, pair in enumerate(zip(before, after, strict=True))}
    else:
        comparable = any("__eq__" in vars(kind) for kind in type(before).__mro__[:-1])
        return f"{path} is changed" if comparable and before != after else ""
    return next(filter(None, (find_change(*pair, name) for name, pair in parts.items())), "")
