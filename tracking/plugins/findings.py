"""Findings of checks that a plug-in keeps its contract."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from statistics import median
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from tracking.errors import spell
from tracking.plugins.plugin_error import PluginError, plugin_call

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


def require(fits: object, told: str) -> None:
    """Raise `Unfit`, which tells what the plug-in does, unless it fits."""
    if not fits:
        raise Unfit(told)


@contextmanager
def judge_plugin(plugin: object = None, method: str = "") -> Iterator[None]:
    """Raise `Unfit` for any exception of a plug-in in the block; arguments as in `plugin_call`."""
    try:
        with plugin_call(plugin, method):
            yield
    except PluginError as error:
        raise Unfit(error.with_place) from error


def try_checks(
    subject: Subject, checks: Mapping[str, Callable[[Subject], str]], needs: Mapping[str, str] = {}
) -> list[Finding]:
    """Findings of checks by name; each check returns what it saw, or raises `Unfit` or `Untried`.

    If the first one fails, the plug-in does not work at all, and the others are not tried. needs: the check, if there
    is one, without which another one tells nothing.
    """
    found: list[Finding] = []
    for name, check in checks.items():
        missed = [one.check for one in found if one.passed is False and one.check in (found[0].check, needs.get(name))]
        try:
            if missed:
                raise Untried(f"it fails {missed[0]!r}")
            found.append(Finding(name, True, check(subject)))
        except Unfit as error:
            found.append(Finding(name, False, str(error)))
        except Untried as error:
            found.append(Finding(name, None, f"not tried: {error}"))
    return found


def time_calls(calls: Iterable[Callable[[], object]]) -> list[float]:
    """Time [s] that each call takes except the first, which may prepare something."""
    seconds = []
    for call in calls:
        start = perf_counter()
        call()
        seconds.append(perf_counter() - start)
    return seconds[1:]


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
