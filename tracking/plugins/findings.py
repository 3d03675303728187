"""Checks that a plug-in keeps its contract, and what they find."""

import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from statistics import mean, median
from typing import Any, TypeVar

from tracking.errors import spell
from tracking.plugins.plugin_error import PluginError, Unusable, plugin_call

Subject = TypeVar("Subject")
_NEES = 2.0, 1.3863  # mean and median NEES of two-dimensional errors with consistent covariances
_FAR, _OFF = 10.0, 4.0  # factors between NEES and a consistent one, from which on a check fails or remarks on it
_MARKS = {True: "passed", False: "FAILED", None: "-"}


@dataclass(frozen=True)
class Finding:
    """Result of one check."""

    check: str
    passed: bool | None  # None: not tried
    seen: str

    def __str__(self) -> str:
        return f"{_MARKS[self.passed]:<8}{self.check:<26}{self.seen}"


class Untried(Exception):
    """A check that is not possible; the message says why."""


def require(fits: object, told: str) -> None:
    """Raise `Unusable`, which says what the plug-in does, unless it fits."""
    if not fits:
        raise Unusable(told)


def try_checks(
    subject: Subject, checks: Mapping[str, Callable[[Subject], str]], needs: Mapping[str, str] = {}
) -> list[Finding]:
    """Findings of checks by name; each returns what it saw, or raises `Untried`, or an exception that is a failure.

    If the first one fails, the plug-in does not work at all, and the others are not tried. needs: the check, if there
    is one, without which another one tells nothing.
    """
    found: list[Finding] = []
    for name, check in checks.items():
        missed = [one.check for one in found if one.passed is False and one.check in (found[0].check, needs.get(name))]
        try:
            if missed:
                raise Untried(f"it fails {missed[0]!r}")
            with plugin_call(passing=(Untried,)):
                found.append(Finding(name, True, check(subject)))
        except PluginError as error:
            found.append(Finding(name, False, error.with_place))
        except Untried as error:
            found.append(Finding(name, None, f"not tried: {error}"))
    return found


def check_nees(squares: Sequence[float]) -> str:
    """Mean and median NEES of positions in words; raise `Unusable` if covariances are ten times too large or small.

    The mean shows whether they are too small. To show whether they are too large the median is needed, too: one gross
    error raises the mean, but not the median.
    """
    if not squares:
        raise Untried("it finds no person")
    mean_nees, median_nees = mean(squares), median(squares)
    small = mean_nees / _NEES[0]
    large = max(good / max(nees, 1e-12) for good, nees in zip(_NEES, (mean_nees, median_nees), strict=True))
    told = f"mean NEES of positions {spell(mean_nees, 3)}, median {spell(median_nees, 3)}; consistent are 2 and 1.39"
    require(large <= _FAR, f"{told}: covariances are far too large, {spell(large, 2)} times")
    require(small <= _FAR, f"{told}: covariances are far too small, {spell(small, 2)} times")
    if max(small, large) > _OFF:
        told += f"; covariances are {spell(max(small, large), 2)} times too {'small' if small > large else 'large'}"
    return told


def describe_time(seconds: Sequence[float], each: str, limit: float = 0.2, step: str = "the time between scans") -> str:
    """Usual and longest time of `each` call, with a remark if it is longer than the `limit` [s] of a `step`."""
    usual = median(seconds)
    late = f"; longer than {step}" if usual > limit else ""
    return f"{_spell_time(usual)} {each}, at most {_spell_time(max(seconds))}{late}"


def _spell_time(seconds: float) -> str:
    return f"{spell(seconds, 3)} s" if seconds >= 1 else f"{spell(1e3 * seconds, 3)} ms"


def find_change(before: Any, after: Any, path: str) -> str:  # noqa: ANN401 - any value
    """The first part of a value that differs from its copy from before, in words; empty if there is none."""
    old, new = _name_parts(before), _name_parts(after)
    if old and old.keys() == new.keys():
        return next(filter(None, (find_change(old[name], new[name], path + name) for name in old)), "")
    return "" if pickle.dumps(before) == pickle.dumps(after) else f"{path} is changed"


def require_untouched(before: object, after: object, path: str) -> None:
    """Raise `Unusable`, which names the part that is changed, if a value differs from its copy from before."""
    changed = find_change(before, after, path)
    require(not changed, changed)


def _name_parts(value: Any) -> dict[str, Any]:  # noqa: ANN401 - any value
    """Fields or items of a value by the code that reaches them (`.name`, `[0]`). Arrays and scalars have none."""
    if is_dataclass(value):
        return {f".{f.name}": getattr(value, f.name) for f in fields(value)}
    if isinstance(value, Mapping):
        return {f"[{key!r}]": part for key, part in value.items()}
    return {f"[{k}]": part for k, part in enumerate(value)} if isinstance(value, list | tuple) else {}
