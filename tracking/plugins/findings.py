"""Findings of checks that a plug-in keeps its contract."""

from collections.abc import Callable
from dataclasses import dataclass

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
