"""Quantities: bounded types of the numbers in a scenario, and parsing of times, intervals and integers."""

import math
import re
from datetime import datetime, timezone
from typing import Annotated

from msgspec import Meta

from tracking.errors import InputError, did_you_mean, spell
from tracking.settings import DAY

Side = Annotated[float, Meta(ge=1, le=20_000)]  # m
Length = Annotated[float, Meta(ge=0.01, le=200)]  # m
Count = Annotated[int, Meta(ge=0, le=10_000)]
Coordinate = Annotated[float, Meta(ge=-1e6, le=1e6)]
Point = tuple[Coordinate, Coordinate]
Projected = Annotated[float, Meta(ge=-1e8, le=1e8)]  # m, easting or northing
Path = Annotated[tuple[Point, ...], Meta(max_length=1000)]  # waypoints, m
Paths = Annotated[tuple[Path, ...], Meta(max_length=10_000)]

MOST_SEED = 2**128 - 1
MOST_LISTED = 100_000
REPEATS = 10_000  # largest number of repeats of one map
WORKERS = 1024  # largest number of processes of one study
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", flags=re.ASCII)
# Date and time of day, parts of a second, and the zone, of ISO 8601.
ISO_TIME = re.compile(r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d(?::\d\d)?)([.,]\d+)?\s*(Z|UTC|[+-]\d\d(?::?\d\d)?)?")
_DATED = 1e9  # s since 1970, in 2001; smaller times are of no clock
_SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}


def parse_number(text: str) -> float:
    """The number in a text such as -1.5e3; NaN for any other text.

    Python's `float` also reads 1_0, inf and the digits of other scripts, which are more likely mistakes.
    """
    return float(text) if _NUMBER.fullmatch(text) else math.nan


def simplify_number(value: float) -> float:
    """A whole number as an integer, so that 1 and 1.0 in a file give the same recording."""
    return int(value) if value == int(value) else value


def count_scans(what: str, rate: float, sensing: int) -> int:
    """Number of scans in a period of a rate [Hz], given the rate of scans; ValueError unless it is a whole number."""
    scans = sensing / rate
    if not math.isclose(scans, round(scans), rel_tol=1e-9):
        near = [n for n in (math.floor(scans), math.ceil(scans)) if n]
        allowed = " and ".join(f"{spell(sensing / n)} Hz ({spell(n / sensing, 6)} s)" for n in near)
        raise ValueError(f"{what} {rate:g} Hz does not divide rates.sensing {sensing} Hz; the nearest: {allowed}")
    return round(scans)


def parse_duration(text: str, field: str, most: float = 366 * DAY) -> float:
    """A positive duration such as 40, 40s or 1.5 min [s], up to `most`; InputError names the field."""
    value = _parse_time(text, field)
    if not 0 < value <= most:
        raise InputError(f"{field}: {text!r} is not allowed; expected more than 0 s, at most {most:.0f} s")
    return value


def parse_iso_time(text: str) -> float | None:
    """Seconds since 1970 of a time such as 2024-05-01T10:00:00+02:00, which is of UTC without a zone; else None.

    ValueError for a day or hour that does not exist.
    """
    if not (found := ISO_TIME.fullmatch(text)):
        return None
    day, clock, part, zone = found.groups()
    zone = "+00:00" if zone in (None, "Z", "UTC") else f"{zone[:3]}:{zone[-2:] if len(zone) > 3 else '00'}"
    try:
        whole = datetime.fromisoformat(f"{day} {clock}{zone}").timestamp()
    except ValueError as error:
        raise ValueError(f"{text!r} is no time: {error}") from error
    return whole + float(f"0.{part[1:]}" if part else 0.0)


def spell_times(*times: float) -> str:
    """One or two times [s] in words, as ISO 8601 has them if they are since 1970."""
    if min(times) < _DATED:
        return f"{' to '.join(map(spell, times))} s"
    dated = (datetime.fromtimestamp(round(time), timezone.utc).isoformat() for time in times)
    return " to ".join(dated).replace("+00:00", "Z")


def parse_interval(text: str, field: str) -> tuple[float, float | None]:
    """Start and end [s] of an interval such as 12:14.5; of a time such as 12 the end is None. Errors name the field."""
    first, colon, last = text.partition(":")
    start = _parse_time(first, field)
    end = _parse_time(last, field) if colon else None
    if start < 0 or (end is not None and end < start):
        raise InputError(f"{field}: {text!r} is not allowed; expected 0 s or more, and in T:T2 no T2 before T")
    return start, end


def _parse_time(text: str, field: str) -> float:
    match = re.fullmatch(r"\s*([-+.\deE]+?)\s*([a-zA-Zµ]*)\s*", text)
    value = parse_number(match[1]) if match else math.nan
    if match is None or not math.isfinite(value):
        raise InputError(f"{field}: {text!r} is not a time; allowed are forms such as 40, 40s, 1.5min")
    if match[2] and match[2] not in _SECONDS:
        raise InputError(f"{field}: {text!r} has the unknown unit {match[2]!r}; {did_you_mean(match[2], _SECONDS)}")
    return value * _SECONDS.get(match[2], 1.0)


def parse_integer(given: object, field: str, *, least: int, most: int) -> int:
    """An integer from `least` to `most`, given as such or as text; InputError names the field."""
    text = str(given)
    if not re.fullmatch(r"\s*[-+]?\d{1,99}\s*", text, flags=re.ASCII) or not least <= int(text) <= most:
        raise InputError(f"{field}: {given!r} is not allowed; expected an integer, {least} to {most}")
    return int(text)


def parse_seed_and_repeat(seed: object, repeat: object, dashes: str = "") -> tuple[int, int]:
    """Seed and repeat of a mission. Text is accepted only with `dashes`, that is, of options of a command.

    InputError names what is wrong.
    """
    numbers = []
    for name, given, most in (("seed", seed, MOST_SEED), ("repeat", repeat, REPEATS - 1)):
        if isinstance(given, str) and not dashes:
            raise InputError(f"{name}: {given!r} is not allowed; expected an integer, 0 to {most}")
        numbers.append(parse_integer(given, f"{dashes}{name}", least=0, most=most))
    return numbers[0], numbers[1]


def parse_integers(text: str, field: str) -> list[int]:
    """Distinct non-negative integers such as 0-9 or 0,3,7-8, in the order given; InputError names the field."""
    found: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d{1,99})\s*(?:-\s*(\d{1,99})\s*)?", part, flags=re.ASCII)
        if match is None or not int(match[1]) <= int(match[2] or match[1]) <= MOST_SEED:
            forms = f"numbers and ranges such as 0-9 or 0,3,7, none above {MOST_SEED}"
            raise InputError(f"{field}: {part!r} is not allowed; expected {forms}")
        listed = range(int(match[1]), int(match[2] or match[1]) + 1)
        if listed[-1] - listed[0] + len(found) >= MOST_LISTED:
            raise InputError(f"{field}: {part!r} makes the list too long; at most {MOST_LISTED} are allowed")
        found += listed
    return list(dict.fromkeys(found))
