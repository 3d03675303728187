"""Findings of checks that a plug-in keeps its contract."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from statistics import median
from typing import Any, TypeVar

import numpy as np

from tracking.errors import spell

Subject = TypeVar("Subject")
_NEES = 0.2, 20.0  # least and largest mean NEES of two-dimensional errors, for which 2 is consistent
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


def try_check(name: str, check: Callable[[], str]) -> Finding:
    """The finding of a check that returns what it saw, or raises `Unfit` or `Untried`."""
    try:
        return Finding(name, True, check())
    except Unfit as error:
        return Finding(name, False, str(error))
    except Untried as error:
        return Finding(name, None, f"not tried: {error}")


def try_checks(subject: Subject, checks: Mapping[str, Callable[[Subject], str]]) -> list[Finding]:
    """Findings of checks by name; each returns what it saw, or raises `Unfit` or `Untried`.

    If the first one fails, the plug-in does not work at all, and the others are not tried.
    """
    found: list[Finding] = []
    for name, check in checks.items():
        if found and not found[0].passed:
            found.append(Finding(name, None, f"not tried: it fails {found[0].check!r}"))
        else:
            found.append(try_check(name, partial(check, subject)))
    return found


def check_nees(nees: float) -> str:
    """The mean NEES of positions in words; raise `Unfit` if covariances are ten times too large or too small."""
    seen = f"mean NEES of positions {spell(nees, 3)}, consistent is 2"
    if not _NEES[0] <= nees <= _NEES[1]:
        raise Unfit(f"{seen}: covariances are far too {'large' if nees < _NEES[0] else 'small'}")
    return seen


def describe_time(seconds: Sequence[float], each: str, limit: float = 0.2, step: str = "the time between scans") -> str:
    """Usual and longest time of `each` call, with a remark if it is longer than the `limit` [s] of a `step`."""
    usual = median(seconds)
    late = f"; longer than {step}" if usual > limit else ""
    return f"{_spell_time(usual)} {each}, at most {_spell_time(max(seconds))}{late}"


def _spell_time(seconds: float) -> str:
    return f"{spell(seconds, 3)} s" if seconds >= 1 else f"{spell(1e3 * seconds, 3)} ms"


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
