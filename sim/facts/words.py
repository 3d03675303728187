"""Words about a mission, before anything draws or prints them: names of fleets, places, shares."""

from collections.abc import Sequence
from typing import NamedTuple

from tracking.errors import list_numbers
from tracking.numerics.arrays import Array


class TextGroup(NamedTuple):
    """A heading, and sentences under it."""

    heading: str
    sentences: list[str]


def name_fleet(uavs: Sequence[int]) -> str:
    """UAVs in words: "UAV 0", "UAVs 0, 1 and 2"."""
    return list_numbers("UAV", uavs)


def name_source(person: int) -> str:
    """The source of a measurement, a person or -1, in words."""
    return f"of person {person}" if person >= 0 else "of a false alarm"


def format_place(place: Array) -> str:
    """A position (2,) m in words."""
    return f"({place[0]:.1f}, {place[1]:.1f}) m"


def format_percent(probability: float) -> str:
    """A probability in per cent, never rounded to certainty."""
    if 0.0 < probability < 0.001:
        return "under 0.1 %"
    if 0.999 < probability < 1.0:
        return "over 99.9 %"
    return f"{100 * probability:.{0 if 0.1 <= probability <= 0.9 or probability in (0.0, 1.0) else 1}f} %"
