"""Contacts of UAVs with other bodies."""

import math
from typing import NamedTuple

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled

KINDS = ("uav", "canopy", "trunk", "person", "ground")
_NAMES = {"uav": "UAV", "canopy": "the canopy of tree", "trunk": "the trunk of tree", "person": "person"}


class Contact(NamedTuple):
    """Contact of a UAV with another body, given by its kind, one of `KINDS`, and its index among its kind."""

    uav: int
    kind: str
    other: int


def describe_body(kind: str, other: int) -> str:
    """Description of the body that a UAV touched; arguments as in `Contact`."""
    return "the ground" if kind == "ground" else f"{_NAMES[kind]} {other}"


@compiled
def nearest_approach(positions: Array, commands: Array, seconds: float) -> float:
    """Lower bound [m] of distances between UAVs at positions (n, 3) m that fly commands (n, 2) m/s for some seconds."""
    least = math.inf
    for i in range(len(positions)):
        for j in range(i):
            gap = positions[i] - positions[j]
            closing = commands[i] - commands[j]
            way = math.sqrt(closing[0] * closing[0] + closing[1] * closing[1]) * seconds
            least = min(least, math.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]) - way)
    return least
