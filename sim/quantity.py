"""Quantities as people type them on a command line."""

from __future__ import annotations

import math
import re

from sim.errors import InputError
from sim.loading import did_you_mean

_SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}


def seconds(text: str, field: str) -> float:
    """A positive duration such as 40, 40s or 1.5 min [s]; InputError names the field."""
    match = re.fullmatch(r"\s*([-+.\deE]+?)\s*([a-zA-Zµ]*)\s*", text)
    try:
        value = float(match[1]) if match else math.nan
    except ValueError:
        value = math.nan
    if match is None or not math.isfinite(value):
        raise InputError(f"{field}: {text!r} is not a duration; allowed are forms such as 40, 40s, 1.5min")
    if match[2] and match[2] not in _SECONDS:
        raise InputError(f"{field}: {text!r} has the unknown unit {match[2]!r}; {did_you_mean(match[2], _SECONDS)}")
    if value <= 0:
        raise InputError(f"{field}: {text!r} is not allowed; expected more than 0 s")
    return value * _SECONDS.get(match[2], 1.0)


def integer(text: str, field: str, *, least: int) -> int:
    """One integer, `least` or more; InputError names the field."""
    if not re.fullmatch(r"\s*[-+]?\d+\s*", text, flags=re.ASCII) or int(text) < least:
        raise InputError(f"{field}: {text!r} is not allowed; expected an integer, {least} or more")
    return int(text)


def integers(text: str, field: str) -> list[int]:
    """Distinct non-negative integers such as 0-9 or 0,3,7-8, in the order given; InputError names the field."""
    found: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)\s*(?:-\s*(\d+)\s*)?", part, flags=re.ASCII)
        if match is None or int(match[2] or match[1]) < int(match[1]):
            raise InputError(f"{field}: {part!r} is not allowed; expected numbers and ranges such as 0-9 or 0,3,7")
        found += range(int(match[1]), int(match[2] or match[1]) + 1)
    return list(dict.fromkeys(found))
